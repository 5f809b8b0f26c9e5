"""One frame of a drive with the scans before it, registered and merged, and the thesis' ground in it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.studies.report import DriveOfStudy
from perception.cli.flags import require_positive
from perception.errors import UsageError
from perception.geometry.grids import LocalArea
from perception.obstacles.ground_planes import PiecewisePlanes, PiecewisePlanesEstimator
from perception.types import Drive, Frame

if TYPE_CHECKING:
    from perception.localization.scan_window import DenseCloud, ScanWindow


@dataclass(frozen=True)
class MergedFrameFlags(DriveOfStudy):
    """Drive and merged scans.

    Attributes:
        frame: Number of the newest scan; else the middle of the drive.
        previous_scans: Number m of scans before it that are merged.
        seed: Seed of RANSAC.
    """

    frame: int | None = None
    previous_scans: int = 6
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate the number of scans."""
        require_positive("--previous-scans", self.previous_scans)


@dataclass(frozen=True)
class MergedFrame:
    """A frame and the m scans before it.

    Attributes:
        frame: Newest frame.
        window: Scans registered to the newest one by Algorithm 2, from the INS or else from LiDAR odometry.
        odometry_window: Scans with the poses of the default method, LiDAR odometry.
        ins_window: Scans with the poses of the INS, those without one left out.
        cloud: Registered scans merged within the area (5.1), in the frame of the newest scan.
        planes: Piecewise planes of the thesis in the merged cloud (Algorithm 3).
        area: Local area around the vehicle.
        title: Drive and frame in words.
        conditions: Drive, frame and parameters.
    """

    frame: Frame
    window: "ScanWindow"
    odometry_window: "ScanWindow"
    ins_window: "ScanWindow"
    cloud: "DenseCloud"
    planes: PiecewisePlanes
    area: LocalArea
    title: str
    conditions: dict[str, Any]


def read_merged_frame(drive: Drive, flags: MergedFrameFlags) -> MergedFrame:
    """Read a frame and the scans before it, register and merge them, and estimate the ground.

    Raises:
        UsageError: The drive has no such frame, or no scan before it.
    """
    from perception.localization.odometry import LidarOdometry
    from perception.localization.registration import register_window
    from perception.localization.scan_window import PosedScan, ScanWindow, merge

    newest = existing_frame(drive, flags.frame, first=1)
    m, odometry, area = flags.previous_scans, LidarOdometry(), LocalArea()
    by_odometry, by_ins = ScanWindow(m), ScanWindow(m)
    for index in range(max(newest - m, 0), newest + 1):
        frame = drive[index]
        points_velo, ins_pose = frame.points_velo, frame.world_SE3_velo
        pose = odometry.update(points_velo, frame.stamp_s, ins_pose, frame.source).world_SE3_velo
        by_odometry.push(PosedScan(points_velo, pose))
        if ins_pose is not None:
            by_ins.push(PosedScan(points_velo, ins_pose))
    window = register_window(by_ins if len(by_ins) == len(by_odometry) else by_odometry)
    cloud, random = merge(window, area), np.random.default_rng(flags.seed)
    planes = PiecewisePlanesEstimator(drive.sensor, area).estimate(cloud.points_velo, random)
    title = f"{drive.name} frame {newest}"
    conditions = {"drive": drive.name, "frame": newest, "window": flags, "area": area}
    return MergedFrame(frame, window, by_odometry, by_ins, cloud, planes, area, title, conditions)


def existing_frame(drive: Drive, frame: int | None, first: int = 0) -> int:
    """Return the number of a frame, or of the middle one for None.

    Raises:
        UsageError: The drive has no such frame.
    """
    chosen = len(drive) // 2 if frame is None else frame
    if not first <= chosen < len(drive):
        raise UsageError(
            f"frame {chosen}",
            expected=f"a frame from {first} to {len(drive) - 1} of {drive.name}",
            found="no such frame",
        )
    return chosen
