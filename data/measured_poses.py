"""Poses of the pipeline beside those of a drive: drawn to the INS, by odometry, and by scans alone."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from data.derived.moving_methods import true_poses
from data.faults.injection import Fault
from data.frames import frame_count
from data.labelled_drives import LabelledDrives
from data.open_drive import open_drive
from data.recorded_drive import RecordedDrive
from data.results.evaluated import EvaluatedDrive
from perception.errors import DriveError
from perception.evaluation.pose_errors import PoseMeasure, PoseReport
from perception.pipeline import PipelineConfig
from perception.types import Float64


def reference_poses(drive: RecordedDrive, count: int) -> tuple[list[Float64], bool]:
    """Return the (4, 4) poses of the first frames of a drive, and whether they are exact: else they are the INS's.

    Args:
        drive: Drive with poses.
        count: Number of frames.

    Raises:
        DriveError: The drive has no poses, a frame has none, or the frames do not follow each other.
    """
    if not (drive.has_poses and drive.is_sequence) or len(drive) < 2:
        raise DriveError(
            drive.root,
            expected="two frames or more with poses that follow each other",
            found="poses of no sequence" if drive.has_poses else "a drive without poses",
        )
    exact = true_poses(drive)
    stated: Sequence[Float64 | None] = exact or [
        drive.world_SE3_velo(index) for index in range(count)
    ]
    known = [pose for pose in stated if pose is not None]
    if len(known) < len(stated):
        found = f"{len(stated) - len(known)} without"
        raise DriveError(drive.root, expected=f"poses of all {count} frames", found=found)
    return known, exact is not None


def measure_poses(
    root: Path, reader: LabelledDrives, pipeline: PipelineConfig
) -> tuple[EvaluatedDrive, str, PoseReport]:
    """Run the pipeline over a drive twice; return its frames, what the poses are compared with, and their errors.

    Args:
        root: Drive with poses.
        reader: How the drive is read.
        pipeline: Configuration of the pipeline up to the segmented scan.

    Raises:
        DriveError: The drive has no poses, a frame has none, or the frames do not follow each other.
        PerceptionError: A frame cannot be read or used.
    """
    drive = open_drive(root, sequence=reader.sequence, config=reader.reading, images=False)
    count = frame_count(drive, reader.frames)
    known, is_exact = reference_poses(drive, count)
    names = ("with INS", "its odometry", "scans alone")
    measures = {name: PoseMeasure(known) for name in names}
    first, odometry, alone = measures.values()
    for result in reader.results(drive, pipeline):
        first.update(result, None, None)
        by_odometry = replace(result, world_SE3_velo=result.odom_SE3_velo, world_SE3_odom=np.eye(4))
        odometry.update(by_odometry, None, None)
    for result in reader.results(drive, pipeline, [Fault("ins-absent", 0, count - 1)]):
        alone.update(result, None, None)
    reference = "exact poses" if is_exact else "INS"
    paths_m = {reference: first.reference_m}
    paths_m |= {name: measure.joined_m for name, measure in measures.items()}
    report = PoseReport(
        {name: measure.compute() for name, measure in measures.items()},
        paths_m,
        first.lengths_m,
        is_exact,
        first.is_flat,
        first.is_level,
    )
    return EvaluatedDrive.of(drive, reader.frames, len(first.reference_m)), reference, report
