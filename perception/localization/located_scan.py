"""A scan with its pose, and what later scans need of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

import numpy as np

from perception.geometry.se3 import inverse, motion_vector, transform_points
from perception.localization.alignment import (
    PreprocessedPoints,
    preprocess_points,
    preprocess_target,
)
from perception.localization.config import RegistrationConfig
from perception.localization.elevation_bias import raised
from perception.types import Bool, Float32, Float64

# Share of a scan's points that move, from which on later scans are not aligned with them. Only some are known: the local area
# is smaller than the scan.
_MIN_MOVING_RATIO = 0.05


class PoseOrigin(StrEnum):
    """Source of a pose."""

    START = "start"  # the first scan: the INS, or the world's origin without one
    REGISTERED = "registered"
    INS = "ins"  # registration was rejected, or the gap was too long for it
    EXTRAPOLATED = (
        "extrapolated"  # the same without INS: constant velocity since the last known pose
    )
    REPEATED = "repeated"  # a stamp that came before


@dataclass(frozen=True)
class Localization:
    """Pose of one scan.

    Attributes:
        world_SE3_velo: (4, 4) refined pose.
        origin: Source of the pose.
        inlier_ratio: Share of the scan that matched; 0 where nothing was registered.
        is_reset: Whether poses of earlier scans no longer fit to this one.
        covariance: (6, 6) covariance since the first scan, position in m and rotation vector in rad along the axes of the
            world.
        of_motion: (6, 6) covariance of the motion since the keyframe or, where nothing was registered, since the last
            scan: how well the pose fits those of the last scans.
    """

    world_SE3_velo: Float64
    origin: PoseOrigin
    inlier_ratio: float = 0.0
    is_reset: bool = False
    covariance: Float64 = field(default_factory=lambda: np.zeros((6, 6)))
    of_motion: Float64 = field(default_factory=lambda: np.zeros((6, 6)))


class RegistrationPoints:
    """Points of a scan: all of them, and those that are not known to move."""

    def __init__(
        self, points_velo: Float32, config: RegistrationConfig, elevation_rad: float
    ) -> None:
        """Take the points, raised by the correction of the elevations so far."""
        self._stride = max(-(-len(points_velo) // config.max_points), 1)
        self._points_velo = raised(points_velo[:: self._stride], elevation_rad)
        self._config = config
        self._is_moving: Bool | None = None
        self.all = self._preprocess(self._points_velo)

    @property
    def is_crowded(self) -> bool:
        """Whether so much moves that it would pull an alignment along."""
        return self._is_moving is not None

    @cached_property
    def static(self) -> PreprocessedPoints:
        """Points that are not known to move."""
        if self._is_moving is None:
            return self.all
        return self._preprocess(self._static_velo)

    def mark_moving(self, is_moving: Bool) -> None:
        """Remember which (N,) points of the whole scan move."""
        is_moving = is_moving[:: self._stride]
        if is_moving.size and is_moving.mean() >= _MIN_MOVING_RATIO:
            self._is_moving = is_moving

    def forget_moving(self) -> None:
        """Forget which points move, where the poses that told it were wrong."""
        self._is_moving = None
        self.__dict__.pop("static", None)

    def raise_beams(self, angle_rad: float) -> None:
        """Move all points to elevations larger by an angle."""
        self._points_velo = raised(self._points_velo, angle_rad)
        self.all = self._preprocess(self._points_velo)
        self.__dict__.pop("static", None)

    def joined(self, others: Sequence[tuple["RegistrationPoints", Float64]]) -> PreprocessedPoints:
        """Return the points of this scan and of others that are not known to move.

        Args:
            others: Points of other scans, each with the (4, 4) transform to this one.
        """
        if not others:
            return self.static
        moved = [transform_points(motion, other._static_velo[:, :3]) for other, motion in others]
        joined = np.concatenate([self._static_velo[:, :3], *moved])
        return preprocess_target(joined, self._config.voxel_size_m)

    @property
    def _static_velo(self) -> Float32:
        return self._points_velo if self._is_moving is None else self._points_velo[~self._is_moving]

    def _preprocess(self, points_velo: Float32) -> PreprocessedPoints:
        return preprocess_points(points_velo, self._config.voxel_size_m)


@dataclass(frozen=True)
class LocatedScan:
    """State that later scans need of an earlier one."""

    stamp_s: float
    ins_world_SE3_velo: Float64 | None
    points: RegistrationPoints
    localization: Localization
    velocity: Float64 | None  # (6,) rotation vector and translation a second, in the LiDAR frame

    def motion_to(self, scan: "LocatedScan") -> Float64:
        """Return the (4, 4) transform from a later scan to this one."""
        return inverse(self.localization.world_SE3_velo) @ scan.localization.world_SE3_velo

    def velocity_to(self, now: Localization, stamp_s: float) -> Float64 | None:
        """Return the (6,) velocity from this scan to a pose, or the one so far where that is not known."""
        if now.origin not in (PoseOrigin.REGISTERED, PoseOrigin.INS):
            return self.velocity
        step = inverse(self.localization.world_SE3_velo) @ now.world_SE3_velo
        return motion_vector(step) / (stamp_s - self.stamp_s)


@dataclass(frozen=True)
class UnlocatedScan:
    """A scan whose motion since the newest keyframe is looked for.

    Attributes:
        points: Its points.
        stamp_s: Its time in seconds.
        keyframe: The newest keyframe.
        surroundings: Static points of the last keyframes in the frame of the newest.
        motion_ins: (4, 4) motion since the keyframe by the INS, or None.
    """

    points: PreprocessedPoints
    stamp_s: float
    keyframe: LocatedScan
    surroundings: PreprocessedPoints
    motion_ins: Float64 | None
