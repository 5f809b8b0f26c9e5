"""One frame of a drive with the scans before it, registered and merged, and the thesis' ground in it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.studies.report import open_study_drive
from perception.cli.flags import require_positive
from perception.cli.parser import FlagGroup
from perception.errors import DriveError, UsageError
from perception.geometry.grids import LocalArea
from perception.localization.odometry import LidarOdometry
from perception.localization.scan_window import DenseCloud, PosedScan, ScanWindow, merge
from perception.obstacles.ground_planes import PiecewisePlanes, PiecewisePlanesEstimator
from perception.types import Drive, Frame


@dataclass(frozen=True)
class MergedFrameFlags(FlagGroup):
    """Merged scans.

    Attributes:
        sequence: Sequence of a tracking folder, such as 0000.
        frame: Number of the newest scan; else the middle of the drive.
        previous_scans: Number m of scans before it that are merged.
        seed: Seed of RANSAC.
    """

    sequence: str | None = None
    frame: int | None = None
    previous_scans: int = 6
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate the number of scans."""
        require_positive("--previous-scans", self.previous_scans)

    def open(self, drive: str) -> Drive:
        """Open a path, or return a synthetic street for the word `synthetic`."""
        return open_study_drive(drive, self.sequence)


@dataclass(frozen=True)
class MergedFrame:
    """A frame and the m scans before it.

    Attributes:
        frame: Newest frame.
        window: Scans with registered poses.
        ins_window: Scans with the poses of the INS, or None without INS.
        cloud: Registered scans merged within the area (5.1), in the frame of the newest scan.
        planes: Piecewise planes of the thesis in the merged cloud (Algorithm 3).
        area: Local area around the vehicle.
        title: Drive and frame in words.
        conditions: Drive, frame and parameters.
    """

    frame: Frame
    window: ScanWindow
    ins_window: ScanWindow | None
    cloud: DenseCloud
    planes: PiecewisePlanes
    area: LocalArea
    title: str
    conditions: dict[str, Any]


def read_merged_frame(drive: Drive, flags: MergedFrameFlags) -> MergedFrame:
    """Read a frame and the scans before it, register and merge them, and estimate the ground.

    Raises:
        UsageError: The drive has no such frame, or no scan before it.
    """
    newest = len(drive) // 2 if flags.frame is None else flags.frame
    if not 0 < newest < len(drive):
        raise UsageError(
            f"frame {newest}",
            expected=f"a frame from 1 to {len(drive) - 1} of {drive.name}",
            found="none that has a scan before it",
        )
    m = flags.previous_scans
    frames = [drive[index] for index in range(max(newest - m, 0), newest + 1)]
    window, ins_window, odometry, area = ScanWindow(m), ScanWindow(m), LidarOdometry(), LocalArea()
    for frame in frames:
        points_velo, by_ins = frame.points_velo, frame.world_SE3_velo
        pose = odometry.update(points_velo, frame.stamp_s, by_ins, frame.source).world_SE3_velo
        window.push(PosedScan(points_velo, pose))
        if by_ins is not None:
            ins_window.push(PosedScan(points_velo, by_ins))
    cloud = merge(window, area)
    estimator = PiecewisePlanesEstimator(drive.sensor, area)
    return MergedFrame(
        frame=frames[-1],
        window=window,
        ins_window=ins_window if len(ins_window) == len(frames) else None,
        cloud=cloud,
        planes=estimator.estimate(cloud.points_velo, np.random.default_rng(flags.seed)),
        area=area,
        title=f"{drive.name} frame {newest}",
        conditions={
            "drive": drive.name, "frame": newest, "previous_scans": m, "seed": flags.seed,
            "area": area,
        },
    )  # fmt: skip


def require_ins(drive: Drive, merged: MergedFrame) -> ScanWindow:
    """Return the scans with the poses of the INS.

    Raises:
        DriveError: The drive has no INS.
    """
    if merged.ins_window is None:
        raise DriveError(
            drive.root, expected="INS poses, to compare with registration", found="none"
        )
    return merged.ins_window
