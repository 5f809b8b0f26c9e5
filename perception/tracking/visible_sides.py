"""Centre of a box from the sides that face the sensor.

    left ^                      Along each axis of the box the outline extends from `low` to
         |   hidden             `high`. An end that faces the sensor is an end of the box. The
    +----+----+                 far end is hidden; it follows from the estimated size. An end
low | outline  :  high + rest   that is observed along the face beside it is measured, too.
    +----+----+
   facing the sensor
"""

from dataclasses import dataclass

import numpy as np

from perception.geometry.footprints import Footprints
from perception.types import Bool, Float64

_COMPLETE_ANGLE_RAD = np.radians(10.0)  # minimum angle to a face whose far end is observed


@dataclass(frozen=True)
class Extents:
    """Extents of F outlines along and across T headings.

    Attributes:
        low_m: (T, F, 2) minimum coordinate along the heading and to the left, from the frame's origin.
        high_m: (T, F, 2) maximum coordinate.
        sensor_m: (T, 2) coordinates of the sensor in the same axes.
    """

    low_m: Float64
    high_m: Float64
    sensor_m: Float64

    @property
    def sizes_m(self) -> Float64:
        """(T, F, 2) observed length and width."""
        return self.high_m - self.low_m

    @property
    def is_complete(self) -> Bool:
        """(T, F, 2) whether both ends along an axis are observed, on a face that is not too slanted.

        Length is observed on the left or right face, width on the front or the rear.
        """
        sensor_m = self.sensor_m[:, None]
        beside_m = np.maximum(self.low_m - sensor_m, sensor_m - self.high_m)
        far_m = np.maximum(np.abs(self.low_m - sensor_m), np.abs(self.high_m - sensor_m))
        return np.asarray(beside_m[..., ::-1] > np.tan(_COMPLETE_ANGLE_RAD) * far_m)


def measure_extents(clusters: Footprints, yaw_rad: Float64, sensor_xy_m: Float64) -> Extents:
    """Measure F outlines along T headings.

    Args:
        clusters: F clusters, at least one.
        yaw_rad: (T,) headings.
        sensor_xy_m: (2,) position of the sensor in the frame of the clusters.
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
    """Return (T, 2) the position of the sensor along each heading and to the left of it."""
    return from_world(np.broadcast_to(sensor_xy_m, (len(yaw_rad), 2)), yaw_rad)


@dataclass(frozen=True)
class Centers:
    """Centres of T boxes that are observed as F outlines, along the heading and to the left.

    Attributes:
        along_left_m: (T, F, 2) coordinates of the centres.
        slack_m: (T, F, 2) difference of observed and estimated size where neither end is known to be the box's.
    """

    along_left_m: Float64
    slack_m: Float64


def place_centers(seen: Extents, sizes_m: Float64) -> Centers:
    """Locate each box by the end that faces the sensor or, where both ends are observed, between them.

    Args:
        seen: Extents of the outlines.
        sizes_m: (T, 2) estimated length and width.
    """
    half_m, sensor_m = sizes_m[:, None] / 2, seen.sensor_m[:, None]
    is_complete = seen.is_complete
    from_low = ~is_complete & (sensor_m < seen.low_m)
    from_high = ~is_complete & (sensor_m > seen.high_m)
    middle_m = (seen.low_m + seen.high_m) / 2
    ends_m = np.where(from_high, seen.high_m - half_m, middle_m)
    slack_m = np.abs(sizes_m[:, None] - seen.sizes_m)
    return Centers(
        np.where(from_low, seen.low_m + half_m, ends_m),
        np.where(from_low | from_high, 0.0, slack_m),
    )


def shift_behind(away_m: Float64, before_m: Float64, after_m: Float64, yaw_rad: Float64) -> Float64:
    """Return (T, 2) the shift over the ground of centres whose boxes change size behind their observed sides.

    Args:
        away_m: (T, 2) centres along the heading and to the left, from the sensor.
        before_m: (T, 2) length and width before.
        after_m: (T, 2) length and width after.
        yaw_rad: (T,) headings.
    """
    is_outside = np.abs(away_m) > before_m / 2
    return to_world(np.sign(away_m) * is_outside * (after_m - before_m) / 2, yaw_rad)


def to_world(along_left_m: Float64, yaw_rad: Float64) -> Float64:
    """Turn (T, ..., 2) coordinates along heading and left back into x and y."""
    shape = (-1,) + (1,) * (along_left_m.ndim - 2)
    cos, sin = np.cos(yaw_rad).reshape(shape), np.sin(yaw_rad).reshape(shape)
    along, left = along_left_m[..., 0], along_left_m[..., 1]
    return np.stack([cos * along - sin * left, sin * along + cos * left], axis=-1)


def from_world(xy_m: Float64, yaw_rad: Float64) -> Float64:
    """Turn (T, ..., 2) x and y into coordinates along heading and left."""
    return to_world(xy_m, -yaw_rad)
