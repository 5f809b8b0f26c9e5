"""Exact truth beside the labels of a written synthetic drive: poses, and boxes all around.

raw        label_02.txt  truth_labels.txt  truth_poses.txt in the drive's folder
tracking   training/{label_02,truth_labels,truth_poses}/SSSS.txt
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.derived.motion_labels import PosedLabels
from data.kitti.labels import empty_labels, read_tracking_labels
from data.kitti.sequence import KittiSequence
from data.recorded_drive import RecordedDrive
from perception.errors import PoseError
from perception.types import Float64


@dataclass(frozen=True)
class TruthFiles:
    """Files of the exact truth of a drive.

    Attributes:
        labels: Boxes of all objects around the vehicle, as tracking labels.
        poses: Poses world_SE3_velo, 12 numbers per row.
    """

    labels: Path
    poses: Path


def truth_files(drive: RecordedDrive) -> TruthFiles | None:
    """Return the files of the exact truth of a drive, or None for a recorded drive."""
    if not isinstance(drive, KittiSequence) or drive.label_file is None:
        return None
    folder, name = drive.label_file.parent, drive.label_file.name
    if name == "label_02.txt":
        files = TruthFiles(folder / "truth_labels.txt", folder / "truth_poses.txt")
    else:
        files = TruthFiles(
            folder.parent / "truth_labels" / name, folder.parent / "truth_poses" / name
        )
    return files if files.labels.is_file() and files.poses.is_file() else None


def read_truth(drive: RecordedDrive, files: TruthFiles) -> list[PosedLabels]:
    """Read the exact boxes and pose of every frame.

    Raises:
        LabelError: The labels cannot be read.
        PoseError: The file does not have one pose for each frame.
    """
    assert drive.calibration is not None
    labels = read_tracking_labels(files.labels, drive.calibration)
    poses = _read_poses(files.poses, max(drive.frame_numbers) + 1)
    return [
        PosedLabels(index, drive.stamp_s(index), poses[number], labels.get(number, empty_labels()))
        for index, number in enumerate(drive.frame_numbers)
    ]


def _read_poses(path: Path, frames: int) -> Float64:
    """Return (F, 4, 4) poses of at least so many frames."""
    try:
        rows = np.loadtxt(path, np.float64, ndmin=2)
    except ValueError as error:
        raise PoseError(path, expected="12 numbers a row", found=str(error)) from error
    if len(rows) < frames or rows.shape[1] != 12 or not np.isfinite(rows).all():
        raise PoseError(
            path, expected=f"{frames} rows of 12 finite numbers", found=f"shape {rows.shape}"
        )
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = rows.reshape(-1, 3, 4)
    return poses
