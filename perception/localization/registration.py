"""Registration: the stage that gives every scan its pose, by LiDAR odometry or by the thesis' ICP."""

from dataclasses import dataclass, field

import numpy as np

from perception.geometry.grids import CroppedScan
from perception.geometry.se3 import inverse
from perception.localization.alignment import align, preprocess_points
from perception.localization.config import RegistrationConfig, WindowIcpConfig
from perception.localization.ins_fusion import InsFusion
from perception.localization.located_scan import PoseOrigin
from perception.localization.odometry import LidarOdometry
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.types import Bool, Float64, Frame, Int, Method


@dataclass(frozen=True)
class RegisteredScans:
    """The newest scan and those before it, with consistent poses.

    Attributes:
        window: Scans and poses, the newest last; that scan alone where its pose is extrapolated.
        rows: Indices of the newest scan's points in its frame.
        is_reset: Whether poses of earlier scans no longer fit to the newest.
        is_extrapolated: Whether the newest pose is that of a constant velocity, as neither scans nor INS tell it.
        world_SE3_odom: (4, 4) correction that draws the poses to the INS.
        covariance: (6, 6) covariance of the newest pose so drawn, without INS since the first scan; NaN by the thesis'
            method.
    """

    window: ScanWindow
    rows: Int
    is_reset: bool
    is_extrapolated: bool = False
    world_SE3_odom: Float64 = field(default_factory=lambda: np.eye(4))
    covariance: Float64 = field(default_factory=lambda: np.full((6, 6), np.nan))


class Registration:
    """Registers the scans of a drive in turn, and keeps those of the window."""

    def __init__(self, config: RegistrationConfig, method: Method, previous_scans: int) -> None:
        """Start without a scan.

        Args:
            config: Registration configuration.
            method: `default` for LiDAR odometry, `thesis` for the INS refined by ICP within the window.
            previous_scans: Number of scans before the newest in the window (m).
        """
        self._config, self._method = config, method
        self._odometry, self._fusion = LidarOdometry(config), InsFusion()
        self._window = ScanWindow(previous_scans)

    @property
    def is_empty(self) -> bool:
        """Whether there is no scan yet."""
        return len(self._window) == 0

    def update(self, frame: Frame, scan: CroppedScan) -> RegisteredScans:
        """Register the scan of a frame.

        Args:
            frame: Frame with its stamp and, where there is an INS, its pose.
            scan: Points of the frame that are registered.

        Raises:
            PoseError: the INS pose jumps, or the stamps do not rise.
        """
        points_velo, rows = scan.points_velo, scan.rows
        if self._method == "thesis" and frame.world_SE3_velo is not None:
            self._window.push(PosedScan(points_velo, frame.world_SE3_velo, stamp_s=frame.stamp_s))
            window = register_window(self._window, self._config.icp)
            return RegisteredScans(window, rows, is_reset=False)
        pose = self._odometry.update(points_velo, frame.stamp_s, frame.world_SE3_velo, frame.source)
        if pose.is_reset:
            self._window.clear()
        is_extrapolated, fusion = pose.origin is PoseOrigin.EXTRAPOLATED, self._fusion
        # A scan that is given twice is no independent observation.
        if pose.origin is PoseOrigin.REPEATED:
            self._window.pop()
        else:
            is_continuous = not (pose.is_reset or is_extrapolated)
            fusion.update(frame, pose.world_SE3_velo, is_continuous=is_continuous)
        # One whose pose is not known stays out of the window.
        window = ScanWindow(0) if is_extrapolated and not pose.is_reset else self._window
        window.push(PosedScan(points_velo, pose.world_SE3_velo, pose.of_motion, frame.stamp_s))
        return RegisteredScans(
            window,
            rows,
            pose.is_reset,
            is_extrapolated,
            fusion.world_SE3_odom,
            pose.covariance if fusion.covariance is None else fusion.covariance,
        )

    def mark_moving(self, is_moving: Bool) -> None:
        """Remember which (N,) points of the newest scan move: later scans are not aligned with them."""
        self._odometry.mark_moving(is_moving)


def register_window(window: ScanWindow, config: WindowIcpConfig | None = None) -> ScanWindow:
    """Align every scan with the newest one, as the thesis does for each frame (Algorithm 2).

    Args:
        window: Scans with INS poses.
        config: Configuration of the box-grid filter and the point-to-point ICP.

    Returns:
        The same scans with refined poses. A scan whose alignment fails keeps its INS pose.
    """
    config = config or WindowIcpConfig()
    newest = window.newest
    target = preprocess_points(newest.points_velo, config.voxel_size_m)
    newest_SE3_world = inverse(newest.world_SE3_velo)
    registered = ScanWindow(previous_scans=len(window) - 1)
    for scan in window:
        pose = scan.world_SE3_velo
        if scan is not newest:
            source = preprocess_points(scan.points_velo, config.voxel_size_m)
            found = align(
                target, source, newest_SE3_world @ pose, config.max_correspondence_m, "ICP"
            )
            if found.is_converged:
                pose = newest.world_SE3_velo @ np.round(found.target_SE3_source, 10)
        registered.push(PosedScan(scan.points_velo, pose, stamp_s=scan.stamp_s))
    return registered
