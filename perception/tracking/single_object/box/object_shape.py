"""Shape of one object in top view, in its own frame: the reward of a point by its position.

left ^                     Reward of a point over the box of the object and a rim around it: highest
     | rim  - - - - -      near the sides that face the sensor, lower inside, negative just outside
     |  - +---------+ -    the box. Past observations (#) count as much as the box.
     |  - | o     # | -
     |  - +#########+ -
     +------- ^ ------> along the heading
            sensor
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from perception.tracking.single_object.box.observation import ObjectObservation
from perception.types import Float32, Float64

CELL_M = 0.05  # edge of a cell of the reward map
_RIM_SHARE = 0.5  # width of the rim in which points count against the box, in its widths
_RIM_M = (0.35, 0.6)  # minimum and maximum width of the rim
_OWN_SHARE = 0.3  # margin beyond which points belong to the background, in widths of the box
_OWN_M = (0.2, 0.4)  # minimum and maximum of that margin
_SIDE_DEVIATION_M = 0.2  # standard deviation of points from the side they lie on
_DEEP_REWARD = 0.3  # reward of a point inside, far from the sides that face the sensor
_RIM_PENALTY = 0.7  # penalty of a point outside
_TOLERANCE_M = 0.1  # distance outside the box up to which a point counts for it
_EDGE_M = 0.15  # width over which the reward falls to the penalty
_VEHICLE_WIDTH_M = 1.3  # minimum width of an object that has sides; narrower bodies have a middle
_NEAR_SHARE = 0.2  # distance of a body's points from its middle towards the sensor, in its widths
_SPREAD_SHARE = 0.25  # spread of a body's points, as a share of its length and width
_MEMORY_SHARE = 0.5  # share of the reward that comes from past observations, after many scans
_MEMORY_SCANS = 3.0  # number of scans after which half of that share is reached
_MEMORY_FADING = 0.02  # share of the past observations that one more scan replaces
_BLUR_M = 0.08  # blur of the past observations


@dataclass(frozen=True)
class ObjectShape:
    """Box of an object and its past observations.

    Attributes:
        size_m: (3,) length, width, height.
        seen: (U, V) how often each cell was observed, along the heading and to the left.
        scans: Number of scans that showed the object.
    """

    size_m: Float64
    seen: Float32
    scans: int

    @classmethod
    def of_box(cls, size_m: Float64) -> "ObjectShape":
        """Return the shape of an object of which only the box is known."""
        reach_m = size_m[:2] / 2 + _clipped(_RIM_SHARE * size_m[1], _RIM_M)
        cells = np.ceil(reach_m / CELL_M).astype(int) * 2 + 3
        return cls(size_m, np.zeros(cells, np.float32), 0)

    @property
    def radius_m(self) -> float:
        """Distance from the middle beyond which points have no reward."""
        rim_m = _clipped(_RIM_SHARE * self.size_m[1], _RIM_M)
        return float(np.hypot(*(self.size_m[:2] / 2 + rim_m)))

    @property
    def own_margin_m(self) -> float:
        """Margin outside the box within which points may be the object's."""
        return _clipped(_OWN_SHARE * self.size_m[1], _OWN_M)

    def cells_of(self, along_m: Float64, left_m: Float64) -> tuple[Float64, Float64]:
        """Return positions in cells, not rounded, along both axes; the map's middle is the box's."""
        rows, columns = self.seen.shape
        scale = 1 / CELL_M
        return along_m * scale + (rows - 1) / 2, left_m * scale + (columns - 1) / 2

    def outside_m(self, along_m: Float64, left_m: Float64) -> Float64:
        """Return the distance outside the box of positions in the object's frame; negative inside."""
        half_m = self.size_m / 2
        return np.asarray(np.maximum(np.abs(along_m) - half_m[0], np.abs(left_m) - half_m[1]))

    def with_observation(self, observation: ObjectObservation, pose: Float64) -> "ObjectShape":
        """Return the shape after one more observation of the object at (3,) a pose."""
        along_m, left_m = into_frame(observation.points_xy_m, pose).T
        rows = self.outside_m(along_m, left_m) < _TOLERANCE_M
        u, v = self.cells_of(along_m[rows], left_m[rows])
        columns = self.seen.shape[1]
        cells = np.rint(u).astype(np.int64) * columns + np.rint(v).astype(np.int64)
        news = np.bincount(cells, observation.weights[rows], self.seen.size).reshape(
            self.seen.shape
        )
        seen = (1 - _MEMORY_FADING) * self.seen + np.minimum(news, 1.0)
        return replace(self, seen=seen.astype(np.float32), scans=self.scans + 1)

    def retained_share(self, blurred: Float32, table: Float32) -> float:
        """Return the reward of the past observations in a blurred map, as a share of that in the sharp one."""
        sharp = float((self.seen * np.maximum(table, 0)).sum())
        return float((self.seen * np.maximum(blurred, 0)).sum()) / sharp if sharp > 0 else 1.0

    def rewards(self, sensor_xy_m: Float64, pose: Float64) -> Float32:
        """Return (U, V) the reward of a point in each cell, for (3,) a pose and (2,) a position of the sensor."""
        sensor_m = into_frame(sensor_xy_m[None], pose)[0]
        u, v = self._axes_m()
        is_vehicle = self.size_m[1] >= _VEHICLE_WIDTH_M
        reward = self._sides(u, v, sensor_m) if is_vehicle else self._middle(u, v, sensor_m)
        if self.scans:
            share = _MEMORY_SHARE * self.scans / (self.scans + _MEMORY_SCANS)
            reward = (1 - share) * reward + share * self._past()
        outside = (self.outside_m(u, v) - _TOLERANCE_M) / _EDGE_M
        rim = np.clip(outside, 0.0, 1.0)
        reward = (1 - rim) * reward - rim * _RIM_PENALTY
        reward[[0, -1]] = 0.0  # the cells of all points that lie farther away
        reward[:, [0, -1]] = 0.0
        return reward.astype(np.float32)

    def _axes_m(self) -> tuple[Float64, Float64]:
        rows, columns = self.seen.shape
        u = (np.arange(rows) - (rows - 1) / 2) * CELL_M
        v = (np.arange(columns) - (columns - 1) / 2) * CELL_M
        return u[:, None], v[None]

    def _sides(self, u: Float64, v: Float64, sensor_m: Float64) -> Float64:
        """Reward points near the sides that face the sensor."""
        depths_m = []
        for position, size, sensor in zip((u, v), self.size_m[:2], sensor_m, strict=True):
            if abs(sensor) > size / 2:
                depths_m.append(size / 2 - np.sign(sensor) * position + 0 * u + 0 * v)
        depth_m = np.minimum.reduce(depths_m) if depths_m else np.zeros_like(u + v)
        near = np.exp(-0.5 * (depth_m / _SIDE_DEVIATION_M) ** 2)
        deep = np.where(depth_m > 0, _DEEP_REWARD, 0.0)
        return np.asarray(np.maximum(near, deep))

    def _middle(self, u: Float64, v: Float64, sensor_m: Float64) -> Float64:
        """Reward points near the middle of a body that does not fill its box."""
        to_sensor = sensor_m / max(float(np.hypot(*sensor_m)), 1e-6)
        push_m = _NEAR_SHARE * self.size_m[1] * to_sensor
        spread_m = _SPREAD_SHARE * self.size_m[:2]
        along, left = (u - push_m[0]) / spread_m[0], (v - push_m[1]) / spread_m[1]
        return np.asarray(np.exp(-0.5 * (along**2 + left**2)))

    def _past(self) -> Float32:
        """Return how often each cell was observed, relative to the cells observed most."""
        smooth = cv2.GaussianBlur(self.seen, (0, 0), _BLUR_M / CELL_M)
        seen = smooth[smooth > 0.02]
        top = float(np.quantile(seen, 0.9)) if len(seen) else 1.0
        return np.asarray(np.minimum(smooth / top, 1.0))


def into_frame(points_xy_m: Float64, pose: Float64) -> Float64:
    """Return (N, 2) positions along and left of (3,) a pose."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x, y = (points_xy_m - pose[:2]).T
    return np.column_stack([cos * x + sin * y, cos * y - sin * x])


def _clipped(value: float, bounds: tuple[float, float]) -> float:
    return float(np.clip(value, *bounds))
