"""Poses of the vehicle from Odometry, or from NavSatFix and Imu, between two messages by interpolation."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from data.bags.message_stream import MessageStream
from data.bags.transforms import pose_of, rotation_of
from data.kitti.oxts import InsPacket, Mercator
from perception.geometry.se3 import from_rotation_translation, interpolate
from perception.types import Float64

_MAX_GAP_NS = 500_000_000  # between two messages; across a longer one the pose is not known
_MAX_DEVIATION_M = 0.5  # of a position; with more, registration alone knows the motion better
_NO_ORIENTATION = -1.0  # first covariance of an Imu that states none
_NO_FIX = 0  # smaller status of a NavSatFix without a position


class PoseSource(ABC):
    """Poses of one frame of the vehicle in a frame fixed to the earth, at any time."""

    @abstractmethod
    def world_SE3_ins(self, stamp_ns: int) -> Float64 | None:
        """Return the (4, 4) pose at a time, or None where no messages are near."""


@dataclass(frozen=True)
class OdometryPoses(PoseSource):
    """Poses of nav_msgs/Odometry.

    Attributes:
        stream: Messages.
    """

    stream: MessageStream

    def world_SE3_ins(self, stamp_ns: int) -> Float64 | None:
        """Return the (4, 4) pose at a time, or None where no messages are near."""
        return _interpolated(self.stream, stamp_ns, lambda message: pose_of(message.pose.pose))


@dataclass(frozen=True)
class NavigationPoses(PoseSource):
    """Positions of sensor_msgs/NavSatFix, in KITTI's Mercator projection, with orientations of sensor_msgs/Imu.

    The Imu's orientation is that of its axes, x forward, in the world: x east, y north, z up (REP 103).

    Attributes:
        fixes: Messages of the positions.
        imu: Messages of the orientations.
        antenna_imu_m: (3,) position of the antenna in the frame of the Imu.
    """

    fixes: MessageStream
    imu: MessageStream
    antenna_imu_m: Float64

    def world_SE3_ins(self, stamp_ns: int) -> Float64 | None:
        """Return the (4, 4) pose at a time, or None where no messages are near."""
        if self._world is None:
            return None
        place = _interpolated(self.fixes, stamp_ns, self._position)
        turn = _interpolated(self.imu, stamp_ns, _orientation)
        if place is None or turn is None:
            return None
        return from_rotation_translation(
            turn[:3, :3], place[:3, 3] - turn[:3, :3] @ self.antenna_imu_m
        )

    @cached_property
    def _world(self) -> Mercator | None:
        """World with its origin at the first fix."""
        for index in range(len(self.fixes)):
            message = self.fixes.read(index)
            if _has_fix(message):
                return Mercator.around(_packet(message))
        return None

    def _position(self, message: Any) -> Float64 | None:  # noqa: ANN401 - see Bag.decode
        if self._world is None or not _has_fix(message):
            return None
        return self._world.world_SE3_imu(_packet(message))


def is_precise(fix: Any) -> bool:  # noqa: ANN401
    """Return whether a fix is, as far as it states, good enough for poses."""
    variances = np.asarray(fix.position_covariance, np.float64)[[0, 4]]
    return not (fix.position_covariance_type and (variances > _MAX_DEVIATION_M**2).any())


def has_orientation(imu: Any) -> bool:  # noqa: ANN401
    """Return whether an Imu states its orientation."""
    return _orientation(imu) is not None


def _orientation(message: Any) -> Float64 | None:  # noqa: ANN401
    if message.orientation_covariance[0] == _NO_ORIENTATION:
        return None
    rotation = rotation_of(message.orientation)
    return None if rotation is None else from_rotation_translation(rotation, np.zeros(3))


def _has_fix(message: Any) -> bool:  # noqa: ANN401
    place = message.latitude, message.longitude, message.altitude
    return message.status.status >= _NO_FIX and bool(np.isfinite(place).all())


def _packet(message: Any) -> InsPacket:  # noqa: ANN401
    return InsPacket(message.latitude, message.longitude, message.altitude)


def _interpolated(stream: MessageStream, stamp_ns: int, read: Any) -> Float64 | None:  # noqa: ANN401
    """Return the pose at a time between those of the messages before and after it."""
    stamps_ns = stream.times.stamps_ns
    after = int(np.searchsorted(stamps_ns, stamp_ns))
    if after < len(stamps_ns) and stamps_ns[after] == stamp_ns:
        found: Float64 | None = read(stream.read(after))
        return found
    before = after - 1
    # A scan of the first and the last moments has messages on one side only.
    if before < 0 or after == len(stamps_ns):
        return None
    gap_ns = int(stamps_ns[after] - stamps_ns[before])
    if gap_ns > _MAX_GAP_NS:
        return None
    poses = [read(stream.read(index)) for index in (before, after)]
    if poses[0] is None or poses[1] is None:
        return None
    return interpolate(poses[0], poses[1], (stamp_ns - int(stamps_ns[before])) / gap_ns)
