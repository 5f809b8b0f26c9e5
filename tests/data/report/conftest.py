"""A run small enough to check by hand: three frames, one track, one vehicle, and a video of plain colours."""

import json
from pathlib import Path

import numpy as np
import pytest

from data.report.label_errors import GroundError, PrecisionPanel
from data.report.run_facts import RunFacts
from perception.render.panels import PanelArea
from perception.render.video import VideoWriter

COLORS = (200, 120, 40)
PANELS = {"Camera": PanelArea(0, 0, 400, 120), "From above": PanelArea(404, 0, 640, 300)}


def place(x, y):
    return {"position_m": [x, y, 0.0], "yaw_rad": 0.0, "velocity_m_s": [2.0, 0.0, 0.0]}


def an_object(track, x, **fields):
    return {
        "id": track, "type": "Car", "score": 0.9, "size_m": [4.0, 1.6, 1.5], "speed_m_s": 2.0, "covariance": None,
        "velo": place(x, 3.0), "world": place(x, 3.0), **fields,
    }  # fmt: skip


def write_lines(path, lines):
    path.write_text("".join(f"{json.dumps(line)}\n" for line in lines))


def write_run(folder: Path, scale: float = 1.0) -> Path:
    """Write the results of a run whose times are scaled."""
    folder.mkdir(parents=True)
    frames, tracks, vehicles = [], [], []
    # Frame 2 could not be read.
    for row, frame in enumerate((0, 1, 3)):
        line = {"frame": frame, "stamp_s": 0.1 * frame}
        seconds = {"ground": 0.01 * scale, "tracking": 0.02 * scale * (1 + row)}
        if frame == 3:
            del seconds["ground"]
        frames.append(
            line | {
                "name": f"{frame:06d}", "invalid_points": 5, "position_m": [frame, 0, 0],
                "points": {"outside": 1, "ground": 2, "static": 3, "moving": 4}, "voxels": {"static": 1, "moving": 1},
                "tracks": 1, "vehicles": 1, "latency_s": 0.06 * scale * (1 + row), "seconds": seconds,
            }
        )  # fmt: skip
        tracks.append(line | {"tracks": [an_object(7, 10.0 + row, is_observed=True)]})
        more = {
            "existence": 0.9, "box_px": [1.0, 2, 3, 4], "dominant_modality": "rgb", "points": 9, "distance_m": 5.0,
            "scores": {"rgb": 0.9, "dm": 0.8, "rm": None},
        }  # fmt: skip
        vehicles.append(line | {"vehicles": [an_object(None, 5.0, **more)]})
    write_lines(folder / "frames.jsonl", frames)
    write_lines(folder / "tracks.jsonl", tracks)
    write_lines(folder / "vehicles.jsonl", vehicles)
    poses = [[1, 0, 0, 10.0 * n, 0, 1, 0, 0, 0, 0, 1, 0] for n in range(3)]
    np.savetxt(folder / "poses.txt", poses)
    summary = {
        "sensor": "HDL-64E", "drive": "<street>", "frames": 3, "elapsed_s": 1.0,
        "stages_ms": {"ground": {"p50": 10 * scale, "p99": 10 * scale, "share_percent": 20},
                      "end to end": {"p50": 120 * scale, "p99": 180 * scale, "share_percent": None}},
        "points_against_truth": {"ground": {"f1": 0.98}}, "tracks": {"ids": 1, "per_frame": 1.0},
        "vehicles": {"ids": 0, "per_frame": 1.0}, "points": {},
    }  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(summary))
    (folder / "config.yaml").write_text("# trifuse 0.1.0: run\nframes: 3\n")
    facts = RunFacts(
        period_s=0.1,
        machine="a processor",
        versions={"trifuse": "0.1.0"},
        panels=PANELS,
        skipped={"ground": 1},
        ground=[GroundError(0, 2, 0.02, 0.03), GroundError(1, 0, None, None)],
        precision=[PrecisionPanel("Car, fused", {"easy: 50.0 % of 9": [1.0] * 21 + [0.0] * 20})],
    )
    facts.write(folder)
    return folder


def write_video(folder: Path) -> None:
    """Write a video of one image of 640 x 360 a frame, the two panels of different grey."""
    with VideoWriter(folder / "video.mp4") as video:
        for value in COLORS:
            image = np.full((360, 640, 3), value, np.uint8)
            image[:, 402:] = value // 2
            video.add(image)


@pytest.fixture
def run_folder(tmp_path) -> Path:
    """Return the results of a run with a video."""
    folder = write_run(tmp_path / "run")
    write_video(folder)
    return folder
