"""Seconds by stage: the thesis' chain as printed, and the default pipeline, on the same frames."""

import time
from collections.abc import Iterator, Mapping, Sequence
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
from perception.types import Drive, Float32, GroundModel

# The four steps of Table 7.3.
DENSE_CLOUD, GROUND = "dense cloud", "ground"
VOXELS, MOTION = "separation and voxels", "static and moving"

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
    _require_frames(drive, frames, longest)
    recent = ScanWindow(longest)
    measured: dict[ThesisCase, list[Times]] = {case: [] for case in cases}
    total = longest + frames
    for frame in progress_bar(read_frames(drive, limit=total), "thesis", total, delay_s=2):
        if frame.world_SE3_velo is None:
            raise DriveError(drive.root, expected="INS poses to begin the ICP with", found="none")
        recent.push(PosedScan(frame.points_velo, frame.world_SE3_velo))
        if len(recent) <= longest:
            continue
        for m in dict.fromkeys(case.previous_scans for case in cases):
            sizes = [case.voxel_size_m for case in cases if case.previous_scans == m]
            for size_m, times in _time_frame(recent, m, sizes, drive.sensor).items():
                measured[ThesisCase(m, size_m)].append(times)
    return measured


def _time_frame(
    recent: ScanWindow, previous_scans: int, sizes_m: Sequence[float], sensor: LidarModel
) -> dict[float, Times]:
    """Run the chain on one frame; the stages that do not depend on the voxel size run once."""
    window = ScanWindow(previous_scans)
    for scan in recent:
        window.push(scan)
    shared: Times = {}
    with _timed(shared, DENSE_CLOUD):
        registered = register_window(window)
        points_velo = merge(registered, _AREA).points_velo
    with _timed(shared, GROUND):
        estimator = PiecewisePlanesEstimator(sensor, _AREA)
        planes = estimator.estimate(points_velo, np.random.default_rng(0))
    with _timed(shared, VOXELS):
        obstacles = _obstacle_points(registered, planes)
    by_size = {size_m: dict(shared) for size_m in sizes_m}
    for size_m, times in by_size.items():
        _time_segmentation(obstacles, size_m, times)
    return by_size


def _obstacle_points(window: ScanWindow, ground: GroundModel) -> list[Float32]:
    newest_SE3_world = inverse(window.newest.world_SE3_velo)
    moved = [
        transform_points(newest_SE3_world @ scan.world_SE3_velo, scan.points_velo)
        for scan in window
    ]
    return [split_by_ground(p, ground, _AREA, _CLEARANCE_M).points_velo for p in moved]


def _time_segmentation(obstacles: list[Float32], size_m: float, times: Times) -> None:
    with _timed(times, VOXELS):
        grid = VoxelGrid.covering(np.concatenate(obstacles), size_m)
        keys = [grid.keys(points) for points in obstacles]
    with _timed(times, MOTION):
        voxels = subtract(keys)
        static, moving = column_counter(grid, voxels.static), column_counter(grid, voxels.moving)
        log_ratio(moving, static)
        classify_columns(static, moving, _STATIC_POINTS, _MOVING_POINTS)


@contextmanager
def _timed(times: Times, stage: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    times[stage] = times.get(stage, 0.0) + time.perf_counter() - start


def time_default(drive: Drive, previous_scans: int, warm_up: int, frames: int) -> list[Times]:
    """Return the seconds by stage of each measured frame of the default pipeline."""
    _require_frames(drive, frames, warm_up)
    pipeline = Pipeline(drive.sensor, PipelineConfig.for_obstacles(previous_scans=previous_scans))
    total = warm_up + frames
    read = progress_bar(read_frames(drive, limit=total), "default", total, delay_s=2)
    return [pipeline.step(frame).timings_s for frame in read][warm_up:]


def _require_frames(drive: Drive, frames: int, before: int) -> None:
    if len(drive) < frames + before:
        raise UsageError(
            f"--frames {frames}",
            expected=f"at most {len(drive) - before}, as {drive.name} has {len(drive)} frames "
            f"and the first {before} fill the window",
            found=str(frames),
        )


def mean_times_s(times: Sequence[Times]) -> Times:
    """Return the mean of each stage over the frames."""
    return {stage: float(np.mean([frame[stage] for frame in times])) for stage in times[0]}


def frames_per_s(times: Sequence[Mapping[str, float]]) -> float:
    """Return the frames per second that the stages allow, one after another."""
    return float(1 / np.mean([sum(frame.values()) for frame in times]))
