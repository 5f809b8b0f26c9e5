"""The folder that `run` leaves: every file is whole, whenever the run ends.

config.yaml          the effective configuration
frames.jsonl         one line a frame: time, pose, counts, seconds by stage
poses.txt            world_SE3_velo after registration, KITTI's 12 numbers a row
tracks/NAME.txt      result rows of KITTI's tracking benchmark; only where there is a camera, only what it sees
tracks.jsonl         one line a frame: every track's id, size, speed, place and heading
data/NNNNNN.txt      result rows of KITTI's object benchmark; as the next two, only where detectors looked
vehicles/NAME.txt    result rows of KITTI's tracking benchmark for detected vehicles
vehicles.jsonl       one line a frame: every detected vehicle's id, score, box, distance, place and speed
followed.jsonl       one line a frame: the track that is followed by itself; only where one is
labels/NNNNNN.label  one uint32 a point in SemanticKITTI's numbers: 40 ground, 9 static, 251 moving
obstacles/NNNNNN.npz static and moving voxels, and the ground's height on a 1 m lattice
video.mp4            camera, 3D and bird's-eye view
picture.jpg          one picture of it
timeline.png         when each stage of a typical frame ran
summary.json         the table that was printed
"""

import json
import time
from io import BytesIO
from pathlib import Path
from typing import Any, Self, TextIO

import numpy as np

from data.atomic_file import write_atomically
from perception.cli.documents import write_json
from perception.cli.track_files import TrackFiles
from perception.cli.vehicle_files import VehicleFiles
from perception.geometry.grids import LocalArea
from perception.types import Drive, Float64, GroundModel, PointState, Result

# SemanticKITTI's numbers; its motion task calls everything that stands 9 and all that moves 251.
SEMANTIC_KITTI = np.zeros(len(PointState), np.uint32)
SEMANTIC_KITTI[PointState.GROUND] = 40
SEMANTIC_KITTI[PointState.STATIC] = 9
SEMANTIC_KITTI[PointState.MOVING] = 251


def new_results_folder(parent: Path) -> Path:
    """Make results/<time> and let results/latest point to it."""
    folder = parent / time.strftime("%Y-%m-%d_%H-%M-%S")
    folder.mkdir(parents=True, exist_ok=True)
    latest = parent / "latest"
    if latest.is_symlink() or not latest.exists():
        latest.unlink(missing_ok=True)
        latest.symlink_to(folder.name)
    return folder


class ResultsFolder:
    """Writes the results of one run, frame by frame; a context manager."""

    def __init__(self, out: Path, drive: Drive, area: LocalArea) -> None:
        """Open the files.

        Args:
            out: the folder, made where it is missing.
            drive: whose results these are.
            area: of which the ground is written.
        """
        self.out, self._area = out, area
        (out / "labels").mkdir(parents=True, exist_ok=True)
        (out / "obstacles").mkdir(exist_ok=True)
        self._frames: TextIO = (out / "frames.jsonl").open("w", buffering=1)
        self._poses: TextIO = (out / "poses.txt").open("w", buffering=1)
        self._tracks = TrackFiles(out, drive.name, drive.calibration)
        self._vehicles = VehicleFiles(out, drive)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._frames.close()
        self._poses.close()
        self._tracks.close()
        self._vehicles.close()

    def write(self, result: Result) -> None:
        """Write what the pipeline made of one frame."""
        name = f"{result.frame.index:06d}"
        labels = SEMANTIC_KITTI[result.obstacles.point_states]
        write_atomically(self.out / "labels" / f"{name}.label", labels.tobytes())
        self._write_obstacles(self.out / "obstacles" / f"{name}.npz", result)
        self._poses.write(" ".join(f"{x:.9g}" for x in result.world_SE3_velo[:3].ravel()) + "\n")
        self._tracks.write(result)
        self._vehicles.write(result)
        self._frames.write(json.dumps(frame_summary(result)) + "\n")

    def _write_obstacles(self, path: Path, result: Result) -> None:
        xy_m, heights_m = sample_ground(result.ground, self._area)
        content = BytesIO()
        np.savez(
            content,
            static_centers_m=result.obstacles.static.centers_m,
            static_counts=result.obstacles.static.counts,
            moving_centers_m=result.obstacles.moving.centers_m,
            moving_counts=result.obstacles.moving.counts,
            ground_xy_m=xy_m,
            ground_height_m=heights_m,
        )
        write_atomically(path, content.getvalue())

    def write_summary(self, summary: object) -> None:
        """Write the figures of the whole run."""
        write_json(self.out / "summary.json", summary)


def sample_ground(ground: GroundModel, area: LocalArea) -> tuple[Float64, Float64]:
    """Return (K, 2) positions on a 1 m lattice over the area and the (K,) ground heights there."""
    x = np.arange(-area.behind_m, area.ahead_m + 0.5)
    y = np.arange(-area.side_m, area.side_m + 0.5)
    xy_m = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return xy_m, ground.height_m(xy_m)


def frame_summary(result: Result) -> dict[str, Any]:
    """Return what one line of frames.jsonl holds."""
    states = np.bincount(result.obstacles.point_states, minlength=len(PointState))
    return {
        "frame": result.frame.index,
        "stamp_s": round(result.frame.stamp_s, 6),
        "position_m": [round(float(x), 4) for x in result.world_SE3_velo[:3, 3]],
        "points": {state.name.lower(): int(states[state]) for state in PointState},
        "voxels": {
            "static": len(result.obstacles.static),
            "moving": len(result.obstacles.moving),
        },
        "tracks": len(result.tracks),
        "vehicles": None if result.vehicles is None else len(result.vehicles),
        "latency_s": round(result.latency_s, 6) if result.spans else None,
        "seconds": {stage: round(seconds, 6) for stage, seconds in result.timings_s.items()},
    }
