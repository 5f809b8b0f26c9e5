"""Mean displacement error over the number of merged scans m and the slice width η (Fig. 7.1)."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.studies.report import RESULTS, DriveOfStudy, formatted_table, publish
from data.derived.obstacle_sequences import SequenceSet, find_sequences
from perception.cli.flags import require_positive
from perception.cli.progress import progress_bar
from perception.errors import DriveError
from perception.evaluation.ground import (
    GroundErrors,
    ground_errors,
    mean_displacement_error,
    pooled_displacement_error,
)
from perception.geometry.grids import LocalArea
from perception.obstacles.config import PiecewisePlanesConfig
from perception.obstacles.ground_planes import PiecewisePlanesEstimator
from perception.render.bar_plots import ValueGrid, plot_grid
from perception.types import Drive

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class GroundErrorConfig(DriveOfStudy):
    """Drive and measured settings.

    Attributes:
        set: Set of sequences: table-3.1, the 8 of the thesis, of which all that DRIVE holds are measured together.
        previous_scans: Values of m, the number of merged scans before the newest.
        steps_per_slice: Values of η, the number of elevation steps of a slice.
        every: Distance between measured frames.
        frames: Number of frames from the start of the drive; else all.
        seed: Seed of RANSAC.
    """

    set: SequenceSet | None = None
    previous_scans: tuple[int, ...] = (2, 4, 6, 8, 10)
    steps_per_slice: tuple[int, ...] = (2, 4, 6, 8, 10)
    every: int = 4
    frames: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate the counts."""
        require_positive("--every", self.every)
        require_positive("--frames", self.frames)


def ground_error(
    drive: str, *, config: GroundErrorConfig, out: Path = RESULTS / "ground-error.png"
) -> None:
    """Measure the thesis' ground over merged scans m and slice width η (Fig. 7.1).

    Example: trifuse study ground-error kitti/tracking --sequence 0000 --every 1

    Args:
        drive: Folder of a drive with labels or of the sequences of a set, or the word synthetic.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    opened, scans, steps = _open(drive, config), config.previous_scans, config.steps_per_slice
    errors = [measure_ground_errors(one, config) for one in opened]
    metrics = {
        pair: pooled_displacement_error(mean_displacement_error(one[pair]) for one in errors)
        for pair in errors[0]
    }
    mde_mm = np.array([[1e3 * metrics[m, eta].mde_m for eta in steps] for m in scans])
    one = next(iter(metrics.values()))
    names = ", ".join(one.name for one in opened)
    title = f"Ground error of the thesis' method, {names}, {one.frames} frames"
    grid = ValueGrid(
        row_name="merged scans before the newest, m",
        rows=scans,
        column_name="elevation steps per slice, η",
        columns=steps,
        values=mde_mm,
        value_name="mDE [mm]",
        digits=1,
    )
    plot_grid(out, title, grid, is_low_good=True)
    specs = {f"η = {eta}": ".1f" for eta in steps}
    rows = {f"m = {m}": values for m, values in zip(scans, mde_mm, strict=True)}
    publish(
        out,
        "Fig. 7.1",
        {"mde_mm": formatted_table(title, "mDE [mm]", specs, rows)},
        {"drive": names, "config": config, "area": LocalArea()},
        frames=one.frames,
        objects=one.objects,
    )


def _open(drive: str, config: GroundErrorConfig) -> Sequence[Drive]:
    """Open the drive, or every sequence of the set that the folder holds."""
    if config.set is None:
        return [config.open(drive)]

    present, absent = find_sequences(Path(drive), config.set, config.sequence)
    if absent:
        log.info("absent: %s", ", ".join(one.name for one in absent))
    return [replace(config, sequence=one.sequence).open(drive) for one in present]


def measure_ground_errors(
    drive: Drive, config: GroundErrorConfig
) -> dict[tuple[int, int], GroundErrors]:
    """Return the errors at labelled objects for each pair (m, η).

    Raises:
        DriveError: The drive has no labels.
    """
    if not drive.has_labels:
        raise DriveError(
            drive.root,
            expected="labelled boxes, whose bottom is on the true ground (7.1)",
            found="none",
            advice="use a KITTI tracking sequence or a synthetic drive",
        )
    from data.frames import read_frames
    from perception.localization.odometry import LidarOdometry
    from perception.localization.registration import register_window
    from perception.localization.scan_window import PosedScan, ScanWindow, merge

    area, odometry = LocalArea(), LidarOdometry()
    window = ScanWindow(max(config.previous_scans))
    errors: dict[tuple[int, int], list[GroundErrors]] = {
        (m, eta): [] for m in config.previous_scans for eta in config.steps_per_slice
    }
    estimators = {
        eta: PiecewisePlanesEstimator(
            drive.sensor, area, PiecewisePlanesConfig(steps_per_slice=eta)
        )
        for eta in config.steps_per_slice
    }
    total = len(drive) if config.frames is None else min(config.frames, len(drive))
    frames = progress_bar(read_frames(drive, limit=total), "ground-error", total, delay_s=2)
    for number, frame in enumerate(frames):
        pose = frame.world_SE3_velo
        if pose is None:
            pose = odometry.update(frame.points_velo, frame.stamp_s, None).world_SE3_velo
        window.push(PosedScan(frame.points_velo, pose))
        bottoms_m = drive.labels(frame.index).boxes_velo.bottom_m
        if number % config.every or not area.contains_xy(bottoms_m).any():
            continue
        cloud = merge(register_window(window), area)  # Algorithm 2
        for (m, eta), rows in errors.items():
            # The newest scans come first in the merged cloud: a smaller m is a part of it.
            points = cloud.points_velo[: np.searchsorted(cloud.age, m, side="right")]
            random = np.random.default_rng([config.seed, frame.index])
            planes = estimators[eta].estimate(points, random)
            rows.append(ground_errors(frame.index, planes, bottoms_m, area))
    return {pair: GroundErrors.concatenate(parts) for pair, parts in errors.items()}
