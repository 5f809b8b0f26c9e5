"""Exact poses of synthetic drives."""

from data.recorded_drive import RecordedDrive
from data.synthetic.drive import SyntheticDrive
from data.synthetic.truth_files import read_truth, truth_files
from perception.types import Drive, Float64


def true_poses(drive: Drive) -> list[Float64] | None:
    """Return the exact (4, 4) world_SE3_velo of every frame of a synthetic drive; None of a recorded one."""
    if isinstance(drive, SyntheticDrive):
        return [drive.true_world_SE3_velo(index) for index in range(len(drive))]
    files = truth_files(drive) if isinstance(drive, RecordedDrive) else None
    if files is None or not isinstance(drive, RecordedDrive):
        return None
    return [posed.world_SE3_velo for posed in read_truth(drive, files)]
