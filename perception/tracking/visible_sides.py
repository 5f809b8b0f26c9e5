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
class Extents:
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

    def is_complete(self, min_angle_rad: float) -> Bool:
        """Tell along which axes (T, F, 2) both ends are seen, on a face that is not too slanted.

        Length is seen on the left or right face, width on the front or the rear.
        """
        sensor_m = self.sensor_m[:, None]
        beside_m = np.maximum(self.low_m - sensor_m, sensor_m - self.high_m)
        far_m = np.maximum(np.abs(self.low_m - sensor_m), np.abs(self.high_m - sensor_m))
        return np.asarray(beside_m[..., ::-1] > np.tan(min_angle_rad) * far_m)


def measure_extents(clusters: Footprints, yaw_rad: Float64, sensor_xy_m: Float64) -> Extents:
    """Measure F outlines along T headings.

    Args:
        clusters: F, at least one.
        yaw_rad: (T,) headings.
        sensor_xy_m: (2,) place of the sensor in the frame of the things.
    """
    cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    x, y = clusters.vertices_m.T
    turned = np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)
    starts = np.asarray(
        np.cumsum(clusters.corners) - np.asarray(clusters.corners, np.int64), np.int64
    )
    return Extents(
        np.minimum.reduceat(turned, starts, axis=1),
        np.maximum.reduceat(turned, starts, axis=1),
        sensor_along(sensor_xy_m, yaw_rad),
    )


def sensor_along(sensor_xy_m: Float64, yaw_rad: Float64) -> Float64:
    """Return (T, 2) the place of the sensor along each heading and to the left of it."""
    return from_world(np.broadcast_to(sensor_xy_m, (len(yaw_rad), 2)), yaw_rad)


@dataclass(frozen=True)
class Centers:
    """Where the centres of T boxes are if they show as F outlines, along heading and left.

    Attributes:
        along_left_m: (T, F, 2).
        slack_m: (T, F, 2) by how much what is seen is too short or too long where nothing says which
            end is true.
    """

    along_left_m: Float64
    slack_m: Float64


def place_centers(seen: Extents, sizes_m: Float64, min_angle_rad: float) -> Centers:
    """Place each box by the one end that faces the sensor or, where both ends are seen, between them.

    Args:
        seen: outlines along headings.
        sizes_m: (T, 2) remembered length and width.
        min_angle_rad: of a face that shows its far end.
    """
    half_m, sensor_m = sizes_m[:, None] / 2, seen.sensor_m[:, None]
    is_complete = seen.is_complete(min_angle_rad)
    from_low = ~is_complete & (sensor_m < seen.low_m)
    from_high = ~is_complete & (sensor_m > seen.high_m)
    middle_m = (seen.low_m + seen.high_m) / 2
    ends_m = np.where(from_high, seen.high_m - half_m, middle_m)
    slack_m = np.abs(sizes_m[:, None] - seen.sizes_m)
    return Centers(
        np.where(from_low, seen.low_m + half_m, ends_m),
        np.where(from_low | from_high, 0.0, slack_m),
    )


def to_world(along_left_m: Float64, yaw_rad: Float64) -> Float64:
    """Turn (T, ..., 2) coordinates along heading and left back into x and y."""
    shape = (-1,) + (1,) * (along_left_m.ndim - 2)
    cos, sin = np.cos(yaw_rad).reshape(shape), np.sin(yaw_rad).reshape(shape)
    along, left = along_left_m[..., 0], along_left_m[..., 1]
    return np.stack([cos * along - sin * left, sin * along + cos * left], axis=-1)


def from_world(xy_m: Float64, yaw_rad: Float64) -> Float64:
    """Turn (T, ..., 2) x and y into coordinates along heading and left."""
    return to_world(xy_m, -yaw_rad)
