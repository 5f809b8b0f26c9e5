"""Seconds by stage: the thesis' chain as printed, and the default pipeline, on the same frames."""

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from data.frames import read_frames
from perception.cli.progress import progress_bar
from perception.errors import DriveError, UsageError
from perception.geometry.grids import LocalArea
from perception.geometry.se3 import inverse, transform_points
from perception.localization.registration import register_window
from perception.localization.scan_window import PosedScan, ScanWindow, merge
from perception.obstacles.above_ground import split_by_ground
from perception.obstacles.ground_planes import PiecewisePlanesEstimator
from perception.obstacles.motion_counters import (
    classify_columns,
    column_counter,
    log_ratio,
    subtract,
)
from perception.obstacles.voxels import VoxelGrid
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import LidarModel
from perception.types import Drive, Float32, Frame

# The four steps of Table 7.3.
DENSE_CLOUD, GROUND = "dense cloud", "ground"
VOXELS, MOTION = "separation and voxels", "static and moving"
PUBLISHED_PERCENT = {DENSE_CLOUD: 83.2, GROUND: 7.1, VOXELS: 7.7, MOTION: 2.0}

_CLEARANCE_M, _STATIC_POINTS, _MOVING_POINTS = 0.2, 50, 5  # Table 7.1
_AREA = LocalArea()

Times = dict[str, float]


@dataclass(frozen=True)
class ThesisCase:
    """One setting of the thesis' chain.

    Attributes:
        previous_scans: Number m of merged scans before the newest.
        voxel_size_m: Edge υ of a voxel in metres.
    """

    previous_scans: int = 6
    voxel_size_m: float = 0.1


def time_thesis(
    drive: Drive, cases: Sequence[ThesisCase], frames: int
) -> dict[ThesisCase, list[Times]]:
    """Return for each case the seconds by stage of each measured frame.

    The first scans only fill the longest window, so that every case is measured on the same frames.
    """
    longest = max(case.previous_scans for case in cases)
    recent = ScanWindow(longest)
    measured: dict[ThesisCase, list[Times]] = {case: [] for case in cases}
    for frame in _read(drive, longest, frames):
        if frame.world_SE3_velo is None:
            raise DriveError(drive.root, expected="INS poses to begin the ICP with", found="none")
        recent.push(PosedScan(frame.points_velo, frame.world_SE3_velo))
        if len(recent) <= longest:
            continue
        for m in dict.fromkeys(case.previous_scans for case in cases):
            # The stages that do not depend on the voxel size run once.
            shared, obstacles = _time_ground(recent, m, drive.sensor)
            for case in cases:
                if case.previous_scans == m:
                    measured[case].append(_time_motion(obstacles, case.voxel_size_m, shared))
    return measured


def _time_ground(
    recent: ScanWindow, previous_scans: int, sensor: LidarModel
) -> tuple[Times, list[Float32]]:
    """Return the times up to the separation, and the points above ground of each scan."""
    window, times = ScanWindow(previous_scans), Times()
    for scan in recent:
        window.push(scan)
    with _timed(times, DENSE_CLOUD):
        window = register_window(window)
        points_velo = merge(window, _AREA).points_velo
    with _timed(times, GROUND):
        estimator = PiecewisePlanesEstimator(sensor, _AREA)
        planes = estimator.estimate(points_velo, np.random.default_rng(0))
    with _timed(times, VOXELS):
        newest_SE3_world = inverse(window.newest.world_SE3_velo)
        obstacles = []
        for scan in window:
            points = transform_points(newest_SE3_world @ scan.world_SE3_velo, scan.points_velo)
            obstacles.append(split_by_ground(points, planes, _AREA, _CLEARANCE_M).points_velo)
    return times, obstacles


def _time_motion(obstacles: list[Float32], size_m: float, shared: Times) -> Times:
    times = dict(shared)
    with _timed(times, VOXELS):
        grid = VoxelGrid.covering(np.concatenate(obstacles), size_m)
        keys = [grid.keys(points) for points in obstacles]
    with _timed(times, MOTION):
        voxels = subtract(keys)
        static, moving = column_counter(grid, voxels.static), column_counter(grid, voxels.moving)
        log_ratio(moving, static)
        classify_columns(static, moving, _STATIC_POINTS, _MOVING_POINTS)
    return times


@contextmanager
def _timed(times: Times, stage: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    times[stage] = times.get(stage, 0.0) + time.perf_counter() - start


def time_default(drive: Drive, previous_scans: int, warm_up: int, frames: int) -> list[Times]:
    """Return the seconds by stage of each measured frame of the default pipeline."""
    pipeline = Pipeline(drive.sensor, PipelineConfig.for_obstacles(previous_scans=previous_scans))
    return [pipeline.step(frame).timings_s for frame in _read(drive, warm_up, frames)][warm_up:]


def _read(drive: Drive, warm_up: int, frames: int) -> Iterable[Frame]:
    total = warm_up + frames
    if len(drive) < total:
        raise UsageError(
            f"--frames {frames}",
            expected=f"at most {len(drive) - warm_up}, as {drive.name} has {len(drive)} frames "
            f"and the first {warm_up} fill the window",
            found=str(frames),
        )
    return progress_bar(read_frames(drive, limit=total), "frames", total, delay_s=2)


def mean_times_s(times: Sequence[Times]) -> Times:
    """Return the mean of each stage over the frames."""
    return {stage: float(np.mean([frame[stage] for frame in times])) for stage in times[0]}


def frames_per_s(times: Sequence[Mapping[str, float]]) -> float:
    """Return the frames per second that the stages allow, one after another."""
    return float(1 / np.mean([sum(frame.values()) for frame in times]))
