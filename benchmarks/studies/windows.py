"""One frame of a drive with the scans before it, posed by the INS and by registration."""

from dataclasses import dataclass

import numpy as np

from perception.errors import DriveError, UsageError
from perception.geometry.grids import LocalArea
from perception.localization.registration import LidarOdometry
from perception.obstacles.dense_cloud import PosedScan, ScanWindow, merge
from perception.obstacles.ground_planes import PiecewisePlanes, PiecewisePlanesEstimator
from perception.types import Drive, Float32, Frame


@dataclass(frozen=True)
class FrameWindows:
    """A frame and the m scans before it.

    Attributes:
        frame: the newest.
        refined: the scans with registered poses.
        by_ins: the same with the poses of the INS, or None without INS.
    """

    frame: Frame
    refined: ScanWindow
    by_ins: ScanWindow | None


def read_windows(drive: Drive, index: int | None, previous_scans: int) -> FrameWindows:
    """Read a frame, else the middle one, and the scans before it.

    Raises:
        UsageError: the drive has no such frame, or there are no scans before it.
    """
    newest = len(drive) // 2 if index is None else index
    if not 0 < newest < len(drive):
        raise UsageError(
            f"frame {newest}",
            expected=f"a frame from 1 to {len(drive) - 1} of {drive.name}",
            found="none that has a scan before it",
        )
    frames = [drive[i] for i in range(max(newest - previous_scans, 0), newest + 1)]
    refined, by_ins = ScanWindow(previous_scans), ScanWindow(previous_scans)
    odometry = LidarOdometry()
    for frame in frames:
        pose = odometry.update(
            frame.points_velo, frame.stamp_s, frame.world_SE3_velo, frame.source
        ).world_SE3_velo
        refined.push(PosedScan(frame.points_velo, pose))
        if frame.world_SE3_velo is not None:
            by_ins.push(PosedScan(frame.points_velo, frame.world_SE3_velo))
    has_ins = len(by_ins) == len(frames)
    return FrameWindows(frames[-1], refined, by_ins if has_ins else None)


def require_ins(drive: Drive, windows: FrameWindows) -> ScanWindow:
    """Return the scans posed by the INS.

    Raises:
        DriveError: the drive has no INS.
    """
    if windows.by_ins is None:
        raise DriveError(
            drive.root, expected="INS poses, to compare with registration", found="none"
        )
    return windows.by_ins


@dataclass(frozen=True)
class ThesisGround:
    """The merged cloud of a window and the thesis' planes in it.

    Attributes:
        points_velo: (K, 4) in the newest scan's frame.
        planes: the ground.
    """

    points_velo: Float32
    planes: PiecewisePlanes


def thesis_ground(
    drive: Drive, window: ScanWindow, area: LocalArea, random: np.random.Generator
) -> ThesisGround:
    """Merge a window (5.1) and estimate its piecewise planes (Algorithm 3)."""
    points_velo = merge(window, area).points_velo
    planes = PiecewisePlanesEstimator(drive.sensor, area).estimate(points_velo, random)
    return ThesisGround(points_velo, planes)
