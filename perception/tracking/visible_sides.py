"""Where the centre of a box is, told by the sides that face the sensor.

    left ^                      Along each axis of the box the outline reaches from `low` to
         |   hidden             `high`. An end that faces the sensor is where the box ends. The
    +----+----+                 end behind is hidden; it follows from the remembered size.
low | outline  :  high + rest   An end that is seen along the face beside it is measured too.
    +----+----+
   facing the sensor
"""

from dataclasses import dataclass

import numpy as np

from perception.geometry.footprints import Footprints
from perception.types import Bool, Float64


@dataclass(frozen=True)
class Reaches:
    """How far each of F outlines reaches along and across each of T headings.

    Attributes:
        low_m: (T, F, 2) least coordinate along heading and left, from the frame's origin.
        high_m: (T, F, 2) greatest.
        sensor_m: (T, 2) the sensor's coordinates in the same axes.
    """

    low_m: Float64
    high_m: Float64
    sensor_m: Float64

    @property
    def sizes_m(self) -> Float64:
        """(T, F, 2) seen length and width."""
        return self.high_m - self.low_m

    def is_complete(self, least_angle_rad: float) -> Bool:
        """Tell along which axes (T, F, 2) both ends are seen, on a face that is not too slanted.

        Length is seen on the left or right face, width on the front or the rear.
        """
        sensor_m = self.sensor_m[:, None]
        beside_m = np.maximum(self.low_m - sensor_m, sensor_m - self.high_m)
        far_m = np.maximum(np.abs(self.low_m - sensor_m), np.abs(self.high_m - sensor_m))
        return np.asarray(beside_m[..., ::-1] > np.tan(least_angle_rad) * far_m)


def reaches(things: Footprints, yaw_rad: Float64, sensor_xy_m: Float64) -> Reaches:
    """Measure F outlines along T headings.

    Args:
        things: F, at least one.
        yaw_rad: (T,) headings.
        sensor_xy_m: (2,) place of the sensor in the frame of the things.
    """
    cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    x, y = things.vertices_m.T
    turned = np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)
    starts = np.asarray(np.cumsum(things.corners) - np.asarray(things.corners, np.int64), np.int64)
    return Reaches(
        np.minimum.reduceat(turned, starts, axis=1),
        np.maximum.reduceat(turned, starts, axis=1),
        sensor_along(sensor_xy_m, yaw_rad),
    )


def sensor_along(sensor_xy_m: Float64, yaw_rad: Float64) -> Float64:
    """Return (T, 2) the place of the sensor along each heading and to the left of it."""
    return from_world(np.broadcast_to(sensor_xy_m, (len(yaw_rad), 2)), yaw_rad)


def place_centers(
    seen: Reaches, sizes_m: Float64, expected_m: Float64, is_complete: Bool
) -> Float64:
    """Return (T, F, 2) the centre of each box along heading and left.

    The centre lies between the place where the box just reaches the low end of what is seen, and the
    place where it just reaches the high end. An end that faces the sensor decides; where neither does,
    or both ends are seen, the centre stays as near to what is expected as that allows.

    Args:
        seen: outlines along headings.
        sizes_m: (T, 2) remembered length and width.
        expected_m: (T, 2) where the centre is expected, along heading and left.
        is_complete: (T, F, 2) along which axes both ends are seen.
    """
    half_m = sizes_m[:, None] / 2
    from_high_m, from_low_m = seen.high_m - half_m, seen.low_m + half_m
    nearest_m, farthest_m = np.minimum(from_high_m, from_low_m), np.maximum(from_high_m, from_low_m)
    center_m = np.clip(expected_m[:, None], nearest_m, farthest_m)
    sensor_m = seen.sensor_m[:, None]
    center_m = np.where(~is_complete & (sensor_m < seen.low_m), from_low_m, center_m)
    return np.asarray(np.where(~is_complete & (sensor_m > seen.high_m), from_high_m, center_m))


def to_world(along_left_m: Float64, yaw_rad: Float64) -> Float64:
    """Turn (T, ..., 2) coordinates along heading and left back into x and y."""
    shape = (-1,) + (1,) * (along_left_m.ndim - 2)
    cos, sin = np.cos(yaw_rad).reshape(shape), np.sin(yaw_rad).reshape(shape)
    along, left = along_left_m[..., 0], along_left_m[..., 1]
    return np.stack([cos * along - sin * left, sin * along + cos * left], axis=-1)


def from_world(xy_m: Float64, yaw_rad: Float64) -> Float64:
    """Turn (T, ..., 2) x and y into coordinates along heading and left."""
    return to_world(xy_m, -yaw_rad)
