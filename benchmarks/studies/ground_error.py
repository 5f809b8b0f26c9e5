"""Mean displacement error over the number of merged scans m and the slice width η (Fig. 7.1)."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.studies.report import Study
from data.frames import read_frames
from perception.cli.table import Cell, format_table
from perception.errors import DriveError
from perception.evaluation.ground import GroundErrors, ground_errors, mean_displacement_error
from perception.geometry.grids import LocalArea
from perception.localization.registration import LidarOdometry
from perception.obstacles.config import PiecewisePlanesConfig
from perception.obstacles.dense_cloud import DenseCloud, PosedScan, ScanWindow, merge
from perception.obstacles.ground_planes import PiecewisePlanesEstimator
from perception.render.plots import ValueGrid, plot_grid
from perception.types import Drive, Float64, Frame

Progress = Callable[[Iterable[Frame]], Iterable[Frame]]


@dataclass(frozen=True)
class GroundErrorConfig:
    """What to measure.

    Attributes:
        previous_scans: values of m.
        steps_per_slice: values of η.
        every: measure in each such frame; all are registered.
        frames: at most so many from the drive's start, or all.
        seed: of RANSAC.
    """

    previous_scans: Sequence[int] = (2, 4, 6, 8, 10)
    steps_per_slice: Sequence[int] = (2, 4, 6, 8, 10)
    every: int = 1
    frames: int | None = None
    seed: int = 0


def study_ground_error(
    drive: Drive, plot_path: Path, config: GroundErrorConfig, progress: Progress
) -> Study:
    """Measure the thesis' piecewise planes for each pair of m and η, and draw the errors as a map."""
    errors = measure_ground_errors(drive, config, progress)
    metrics = {pair: mean_displacement_error(rows) for pair, rows in errors.items()}
    mde_m = np.array(
        [[metrics[m, eta].mde_m for eta in config.steps_per_slice] for m in config.previous_scans]
    )
    any_metrics = next(iter(metrics.values()))
    title = f"Ground error of the thesis' method, {drive.name}, {any_metrics.frames} frames"
    grid = ValueGrid(
        row_name="merged scans before the newest, m",
        rows=config.previous_scans,
        column_name="elevation steps a slice, η",
        columns=config.steps_per_slice,
        values=1e3 * mde_m,
        value_name="mDE [mm]",
        digits=1,
    )
    plot_grid(plot_path, title, grid, is_low_good=True)
    return Study(
        name="ground-error",
        repeats="Fig. 7.1",
        table=_table(title, config, mde_m),
        numbers={
            "mde_m": mde_m,
            "frames": any_metrics.frames,
            "objects": any_metrics.objects,
        },
        conditions={"drive": drive.name, "plan": config, "area": LocalArea()},
    )


def measure_ground_errors(
    drive: Drive, config: GroundErrorConfig, progress: Progress
) -> dict[tuple[int, int], GroundErrors]:
    """Return the errors at labelled objects for each pair (m, η).

    Raises:
        DriveError: the drive has no labels.
    """
    if not drive.has_labels:
        raise DriveError(
            drive.root,
            expected="labelled boxes, whose feet stand on the true ground (7.1)",
            found="none",
            advice="use a KITTI tracking sequence or a synthetic drive",
        )
    area, odometry = LocalArea(), LidarOdometry()
    window = ScanWindow(max(config.previous_scans))
    errors: dict[tuple[int, int], list[GroundErrors]] = {
        (m, eta): [] for m in config.previous_scans for eta in config.steps_per_slice
    }
    for number, frame in enumerate(progress(read_frames(drive, limit=config.frames))):
        pose = odometry.update(frame.points_velo, frame.stamp_s, frame.world_SE3_velo)
        window.push(PosedScan(frame.points_velo, pose.world_SE3_velo))
        bottom_centers_m = drive.labels(frame.index).boxes_velo.bottom_m
        if number % config.every == 0 and area.contains_xy(bottom_centers_m).any():
            _measure_frame(
                drive, merge(window, area), bottom_centers_m, frame.index, config.seed, errors
            )
    return {pair: GroundErrors.concatenate(parts) for pair, parts in errors.items()}


def _measure_frame(
    drive: Drive,
    cloud: DenseCloud,
    bottom_centers_m: Float64,
    index: int,
    seed: int,
    errors: dict[tuple[int, int], list[GroundErrors]],
) -> None:
    area = LocalArea()
    # The newest scans come first in the merged cloud: a smaller m is a part of it.
    for (m, eta), rows in errors.items():
        method = PiecewisePlanesEstimator(
            drive.sensor, area, PiecewisePlanesConfig(steps_per_slice=eta)
        )
        points = cloud.points_velo[: np.searchsorted(cloud.age, m, side="right")]
        planes = method.estimate(points, np.random.default_rng([seed, index]))
        rows.append(ground_errors(index, planes, bottom_centers_m, area))


def _table(title: str, config: GroundErrorConfig, mde_m: Float64) -> str:
    rows: list[list[Cell]] = [
        [f"m = {m}", *(f"{1e3 * value:.1f}" for value in values)]
        for m, values in zip(config.previous_scans, mde_m, strict=True)
    ]
    header = ("mDE [mm]", *(f"η = {eta}" for eta in config.steps_per_slice))
    return format_table(title, header, rows)
