"""What results must not depend on: the place on the globe, the clock, the rate, and the machine's settings."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from data.synthetic.drive import SyntheticDrive
from perception.geometry.grids import MOVING_OBJECT_AREA
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import VLP_16
from perception.types import Frame, Result
from tests.car_frames import write_car_frames

FRAMES = 8
LIDAR_ALONE = PipelineConfig.for_motion()
# Where the first pose is written to, in metres; the last is a place by its UTM coordinates.
PLACES = {
    "10 km away": (10_000.0, -10_000.0, 0.0),
    "3000 m up": (0.0, 0.0, 3_000.0),
    "on the globe": (500_000.0, 5_400_000.0, 420.0),
}


def results_of(frames, sensor=VLP_16) -> list[Result]:
    pipeline = Pipeline(sensor, LIDAR_ALONE)
    return [pipeline.step(frame) for frame in frames]


def elsewhere(frame: Frame, shift_m) -> Frame:
    world_SE3_velo = frame.world_SE3_velo.copy()
    world_SE3_velo[:3, 3] += shift_m
    return replace(frame, world_SE3_velo=world_SE3_velo)


@pytest.fixture(scope="module")
def frames():
    return list(SyntheticDrive(FRAMES, sensor=VLP_16, images=False))


@pytest.fixture(scope="module")
def here(frames):
    return results_of(frames)


def assert_same_scene(found: Result, expected: Result) -> None:
    states, expected_states = found.obstacles.point_states, expected.obstacles.point_states
    assert np.count_nonzero(states != expected_states) <= 3  # on the edge of a threshold
    assert found.tracks.ids.tolist() == expected.tracks.ids.tolist()
    np.testing.assert_allclose(
        found.tracks.boxes.bottom_m, expected.tracks.boxes.bottom_m, atol=1e-3
    )
    np.testing.assert_allclose(
        found.tracks.velocities_m_s, expected.tracks.velocities_m_s, atol=1e-2
    )


@pytest.mark.parametrize("place", PLACES)
def test_the_place_on_the_globe_does_not_matter(frames, here, place):
    found = results_of([elsewhere(frame, PLACES[place]) for frame in frames])
    for one, other in zip(found, here, strict=True):
        assert_same_scene(one, other)
    assert len(here[-1].tracks) > 0


# Half a day before and after the second that was inserted into 2016, at the wrap of 32 bits, in 2100.
@pytest.mark.parametrize("start_s", [1483185600.0, 1483272000.0, 2.0**31, 2.0**32, 4102444800.0])
def test_the_clock_does_not_matter(frames, here, start_s):
    found = results_of([replace(one, stamp_s=start_s + one.stamp_s) for one in frames])
    for one, other in zip(found, here, strict=True):
        assert_same_scene(one, other)


def test_twice_the_rate_gives_the_same_velocities():
    tracks = {}
    for rate_hz in (10.0, 20.0):
        sensor = replace(VLP_16, rate_hz=rate_hz)
        drive = SyntheticDrive(int(1.2 * rate_hz), sensor=sensor, images=False)
        every = results_of(drive, sensor)[-1].tracks
        # Farther ones are known by few beams.
        tracks[rate_hz] = every[MOVING_OBJECT_AREA.contains_xy(every.boxes.bottom_m)]
    places_m, other_places_m = (one.boxes.bottom_m[:, :2] for one in tracks.values())
    apart_m = np.linalg.norm(places_m[:, None] - other_places_m, axis=2)
    nearest = apart_m.argmin(axis=1)
    # Half a metre an object moves between the last scans of both, and another one the ends that a beam finds.
    assert apart_m.min(axis=1).max() < 1.0
    slow, fast = tracks[10.0].velocities_m_s, tracks[20.0].velocities_m_s[nearest]
    np.testing.assert_allclose(fast, slow, atol=1.0)
    assert len(slow) >= 2


# What a user's machine may have set, in two ways that share nothing.
SETTINGS = (
    {"TZ": "UTC", "LC_ALL": "C", "PYTHONHASHSEED": "0", "OMP_NUM_THREADS": "1"},
    {"TZ": "Asia/Kathmandu", "LC_ALL": "tr_TR.UTF-8", "PYTHONHASHSEED": "41", "OMP_NUM_THREADS": "2"},
)  # fmt: skip


def test_the_settings_of_the_machine_do_not_matter(tmp_path):
    drive = tmp_path / "drive"
    write_car_frames(drive, frames=3)
    files = []
    for number, settings in enumerate(SETTINGS):
        out = tmp_path / str(number)
        threads = {"OPENBLAS_NUM_THREADS": settings["OMP_NUM_THREADS"]}
        words = [sys.executable, "-m", "perception", "run", str(drive), "--out", str(out)]
        flags = ["--no-video", "--no-report", f"--pipeline.{'no-' * number}parallel"]
        subprocess.run(
            [*words, *flags],
            env={**os.environ, **settings, **threads},
            cwd=Path(__file__).parents[2],
            check=True,
            capture_output=True,
        )
        files.append(results_in(out))
    assert files[0].keys() == files[1].keys()
    assert [name for name in files[0] if files[0][name] != files[1][name]] == []


TIMES = ("latency_s", "seconds")  # of the machine, not of the drive


def results_in(folder: Path) -> dict[str, object]:
    """Return what the files of a run hold, without its configuration and the times that it took."""
    found: dict[str, object] = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        name = str(path.relative_to(folder))
        if name == "frames.jsonl":
            lines = [json.loads(line) for line in path.read_text().splitlines()]
            found[name] = [{k: v for k, v in line.items() if k not in TIMES} for line in lines]
        elif name not in ("config.yaml", "summary.json", "timeline.png"):
            found[name] = path.read_bytes()
    return found
