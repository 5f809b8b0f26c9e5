"""KITTI's INS packets ("oxts"), read, written, and turned into poses in metres.

One packet is one row of 30 numbers: a file a frame in raw recordings, a line a frame in tracking
sequences. The IMU has x forward, y left, z up; its pose is given on the globe, as latitude,
longitude and altitude, and as roll, pitch and yaw, where yaw is 0 to the east and grows to the north.
"""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from perception.errors import PoseError
from perception.geometry.se3 import from_euler
from perception.types import Float64

EARTH_RADIUS_M = 6378137.0
_FIELDS = 30
_MAX_LATITUDE_DEG = 89.0  # Mercator's projection ends short of the poles
_STATUS = "4 10 4 4 0"  # navigation state, satellites, position, velocity and orientation mode


@dataclass(frozen=True)
class InsPacket:
    """Position of the IMU on the globe, and its motion.

    Attributes:
        latitude_deg: Latitude in degrees, north positive.
        longitude_deg: Longitude in degrees, east positive.
        altitude_m: Altitude above sea level in metres.
        roll_rad: Roll in radians, left side up positive.
        pitch_rad: Pitch in radians, front down positive.
        yaw_rad: Yaw in radians, 0 to the east, counter-clockwise.
        velocity_level_m_s: (3,) velocity forward, left and up, in the horizontal plane.
        acceleration_imu_m_s2: (3,) acceleration along the axes of the IMU, gravity included.
        rate_imu_rad_s: (3,) angular rates about the axes of the IMU.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0
    velocity_level_m_s: Float64 = field(default_factory=partial(np.zeros, 3))
    acceleration_imu_m_s2: Float64 = field(default_factory=partial(np.zeros, 3))
    rate_imu_rad_s: Float64 = field(default_factory=partial(np.zeros, 3))


@dataclass(frozen=True)
class Mercator:
    """A flat world with x east, y north and z up in metres, by KITTI's Mercator projection.

    KITTI takes the scale from the first latitude. Here the origin is put at the first packet too, so
    that positions stay small and keep their precision.

    Attributes:
        latitude_deg: Latitude of the origin in degrees.
        longitude_deg: Longitude of the origin in degrees.
        altitude_m: Altitude of the origin in metres.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float

    @classmethod
    def around(cls, packet: InsPacket) -> "Mercator":
        """Set the origin at a packet."""
        return cls(packet.latitude_deg, packet.longitude_deg, packet.altitude_m)

    @property
    def _scaled_radius_m(self) -> float:
        return float(EARTH_RADIUS_M * np.cos(np.radians(self.latitude_deg)))

    def world_SE3_imu(self, packet: InsPacket) -> Float64:
        """Return the pose of the IMU at a packet."""
        east = np.radians(packet.longitude_deg - self.longitude_deg)
        north = _mercator_rad(packet.latitude_deg) - _mercator_rad(self.latitude_deg)
        position_m = np.array([self._scaled_radius_m * east, self._scaled_radius_m * north, 0.0])
        position_m[2] = packet.altitude_m - self.altitude_m
        return from_euler(packet.roll_rad, packet.pitch_rad, packet.yaw_rad, position_m)

    def packet(
        self,
        world_SE3_imu: Float64,
        velocity_world_m_s: Float64,
        acceleration_imu_m_s2: Float64,
        rate_imu_rad_s: Float64,
    ) -> InsPacket:
        """Return the packet of an INS at a pose: the inverse of `world_SE3_imu`."""
        east_m, north_m, up_m = world_SE3_imu[:3, 3]
        stretched_rad = _mercator_rad(self.latitude_deg) + north_m / self._scaled_radius_m
        yaw, pitch, roll = Rotation.from_matrix(world_SE3_imu[:3, :3]).as_euler("ZYX")
        return InsPacket(
            latitude_deg=float(np.degrees(2 * np.arctan(np.exp(stretched_rad)) - np.pi / 2)),
            longitude_deg=self.longitude_deg + float(np.degrees(east_m / self._scaled_radius_m)),
            altitude_m=self.altitude_m + float(up_m),
            roll_rad=float(roll),
            pitch_rad=float(pitch),
            yaw_rad=float(yaw),
            velocity_level_m_s=_turn(velocity_world_m_s, -yaw),
            acceleration_imu_m_s2=acceleration_imu_m_s2,
            rate_imu_rad_s=rate_imu_rad_s,
        )


def _mercator_rad(latitude_deg: float) -> float:
    """Return the Mercator latitude, on which a step north is as long as a step east."""
    return float(np.log(np.tan(np.pi / 4 + np.radians(latitude_deg) / 2)))


def _turn(vector: Float64, yaw_rad: float) -> Float64:
    return from_euler(0, 0, yaw_rad)[:3, :3] @ vector


def velocity_world_m_s(packet: InsPacket) -> Float64:
    """Return (3,) the velocity to the east, to the north and up."""
    return _turn(packet.velocity_level_m_s, packet.yaw_rad)


def parse_oxts_packet(row: str, source: str | Path) -> InsPacket:
    """Read one packet.

    Raises:
        PoseError: The row has too few or non-finite numbers, or its position is not on the map.
    """
    try:
        numbers = np.array(row.split(), np.float64)
    except ValueError as error:
        raise PoseError(source, expected="an INS packet of numbers", found=repr(row)) from error
    if len(numbers) < _FIELDS or not np.isfinite(numbers).all():
        raise PoseError(
            source,
            expected=f"an INS packet of {_FIELDS} finite numbers",
            found=f"{int(np.isfinite(numbers).sum())}",
        )
    if abs(numbers[0]) > _MAX_LATITUDE_DEG or abs(numbers[1]) > 180:
        raise PoseError(
            source,
            expected=f"a latitude within {_MAX_LATITUDE_DEG:g} and a longitude within 180 degrees",
            found=f"{numbers[0]:g} and {numbers[1]:g}",
        )
    latitude_deg, longitude_deg, altitude_m, roll_rad, pitch_rad, yaw_rad = numbers[:6].tolist()
    return InsPacket(
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_m=altitude_m,
        roll_rad=roll_rad,
        pitch_rad=pitch_rad,
        yaw_rad=yaw_rad,
        velocity_level_m_s=numbers[8:11],
        acceleration_imu_m_s2=numbers[11:14],
        rate_imu_rad_s=numbers[17:20],
    )


def format_oxts_packet(packet: InsPacket) -> str:
    """Return the row that `parse_oxts_packet` reads, without a line end."""
    east_m_s, north_m_s, _ = velocity_world_m_s(packet)
    tilt = from_euler(packet.roll_rad, packet.pitch_rad, 0)[:3, :3]
    position = f"{packet.latitude_deg:.13f} {packet.longitude_deg:.13f} {packet.altitude_m:.6f}"
    numbers = np.concatenate(
        [
            (packet.roll_rad, packet.pitch_rad, packet.yaw_rad, north_m_s, east_m_s),
            packet.velocity_level_m_s,
            packet.acceleration_imu_m_s2,
            tilt @ packet.acceleration_imu_m_s2,
            packet.rate_imu_rad_s,
            tilt @ packet.rate_imu_rad_s,
            (0.05, 0.03),  # accuracy of position in metres, and of velocity in metres per second
        ]
    )
    return f"{position} {' '.join(f'{number:.12g}' for number in numbers)} {_STATUS}"
