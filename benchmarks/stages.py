"""A stretch of a drive in memory for all stages alike, and its voxels."""

from dataclasses import dataclass

from benchmarks.measure import Comparison, Contender, compare
from benchmarks.reference.voxels import count_voxels_by_unique_rows
from perception.errors import DriveError
from perception.localization.odometry import LidarOdometry
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.obstacles.voxels import count_voxels
from perception.pipeline import PipelineConfig
from perception.types import Drive, Frame


@dataclass(frozen=True)
class PreparedDrive:
    """A stretch of a drive in memory, registered once, for all stages alike.

    Attributes:
        drive: Drive that was read.
        frames: Frames in order.
        windows: Window of scans of each frame, with registered poses.
        config: Pipeline configuration.
    """

    drive: Drive
    frames: list[Frame]
    windows: list[ScanWindow]
    config: PipelineConfig


def prepare(drive: Drive, frames: int, config: PipelineConfig) -> PreparedDrive:
    """Read and register a number of frames from the start of a drive."""
    odometry, scans, read = LidarOdometry(config.registration), [], []
    for index in range(min(frames, len(drive))):
        frame = drive[index]
        pose = odometry.update(
            frame.points_velo, frame.stamp_s, frame.world_SE3_velo, frame.source
        ).world_SE3_velo
        read.append(frame)
        scans.append(PosedScan(frame.points_velo, pose, stamp_s=frame.stamp_s))
    if len(scans) < 2:
        raise DriveError(drive.root, expected="at least two frames", found=str(len(scans)))
    windows = []
    for newest in range(len(scans)):
        window = ScanWindow(config.motion.previous_scans)
        for scan in scans[max(0, newest - config.motion.previous_scans) : newest + 1]:
            window.push(scan)
        windows.append(window)
    return PreparedDrive(drive, read, windows, config)


def compare_voxels(prepared: PreparedDrive) -> Comparison:
    """Count the voxels of whole scans, beside numpy's unique rows."""
    size_m = 0.1
    contenders = [
        Contender("Trifuse", lambda i: count_voxels(prepared.frames[i].points_velo, size_m)),
        Contender(
            "reference: np.unique over rows",
            lambda i: count_voxels_by_unique_rows(prepared.frames[i].points_velo, size_m),
        ),
    ]
    return compare("voxel counting", contenders, len(prepared.frames))
