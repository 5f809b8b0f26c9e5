"""What one object looks like from above, in its own frame: where its points lie, and where none should.

left ^                     Rewards per point, over the box of the object and a rim around it:
     | rim  - - - - -      near the sides that face the sensor a point is worth most, deeper inside
     |  - +---------+ -    less, just outside the box it speaks against it. What was seen of the
     |  - | o     # | -    object so far (#) counts as much as what a box suggests.
     |  - +#########+ -
     +------- ^ ------> along the heading
            sensor
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from perception.tracking.single_object.box.observation import ObjectObservation
from perception.types import Float32, Float64


@dataclass(frozen=True)
class ObjectShapeConfig:
    """What a point is worth by its place.

    Attributes:
        cell_m: of the raster.
        rim_share: share of its width by which points outside the box still speak against it.
        rim_m: least and most of that.
        own_share: share of its width beyond which points outside the box are something else's.
        own_m: least and most of that.
        side_deviation_m: of points from the side they lie on.
        deep_reward: of a point inside, far from the sides that face the sensor.
        rim_penalty: of a point outside.
        tolerance_m: outside the box by so much, a point may still belong to it.
        edge_m: from there a point's worth falls to the penalty.
        vehicle_width_m: what is narrower has no sides, but a middle.
        near_share: share of its width by which the points of a body lie before its middle.
        spread_share: share of its length and width by which they spread.
        memory_share: how much of the reward comes from what was seen, once enough was.
        memory_scans: after how many scans that is half so.
        memory_fading: share of what was seen that one more scan replaces.
        blur_m: around what was seen.
    """

    cell_m: float = 0.05
    rim_share: float = 0.5
    rim_m: tuple[float, float] = (0.35, 0.6)
    own_share: float = 0.3
    own_m: tuple[float, float] = (0.2, 0.4)
    side_deviation_m: float = 0.2
    deep_reward: float = 0.3
    rim_penalty: float = 0.7
    tolerance_m: float = 0.1
    edge_m: float = 0.15
    vehicle_width_m: float = 1.3
    near_share: float = 0.2
    spread_share: float = 0.25
    memory_share: float = 0.5
    memory_scans: float = 3.0
    memory_fading: float = 0.02
    blur_m: float = 0.08


@dataclass(frozen=True)
class ObjectShape:
    """The box's size and what was seen of the object.

    Attributes:
        size_m: (3,) length, width, height.
        seen: (U, V) how much was seen in each cell, along the heading and to the left.
        scans: how many scans it was seen in.
        config: what points are worth.
    """

    size_m: Float64
    seen: Float32
    scans: int
    config: ObjectShapeConfig

    @classmethod
    def of_box(cls, size_m: Float64, config: ObjectShapeConfig) -> "ObjectShape":
        """Return the shape of an object of which only the box is known."""
        reach_m = size_m[:2] / 2 + _clipped(config.rim_share * size_m[1], config.rim_m)
        cells = np.ceil(reach_m / config.cell_m).astype(int) * 2 + 3
        return cls(size_m, np.zeros(cells, np.float32), 0, config)

    @property
    def radius_m(self) -> float:
        """How far from the middle points may say something."""
        rim_m = _clipped(self.config.rim_share * self.size_m[1], self.config.rim_m)
        return float(np.hypot(*(self.size_m[:2] / 2 + rim_m)))

    @property
    def own_margin_m(self) -> float:
        """How far outside the box points may still be the object's."""
        return _clipped(self.config.own_share * self.size_m[1], self.config.own_m)

    def cells_of(self, along_m: Float64, left_m: Float64) -> tuple[Float64, Float64]:
        """Return places in cells, not rounded, along both axes; the raster's middle is the box's."""
        rows, columns = self.seen.shape
        scale = 1 / self.config.cell_m
        return along_m * scale + (rows - 1) / 2, left_m * scale + (columns - 1) / 2

    def outside_m(self, along_m: Float64, left_m: Float64) -> Float64:
        """Return how far outside the box places in the object's frame lie; negative inside."""
        half_m = self.size_m / 2
        return np.asarray(np.maximum(np.abs(along_m) - half_m[0], np.abs(left_m) - half_m[1]))

    def with_observation(self, observation: ObjectObservation, pose: Float64) -> "ObjectShape":
        """Return the shape with what one more scan showed, the object being at (3,) a pose."""
        along_m, left_m = into_frame(observation.points_xy_m, pose).T
        rows = self.outside_m(along_m, left_m) < self.config.tolerance_m
        u, v = self.cells_of(along_m[rows], left_m[rows])
        columns = self.seen.shape[1]
        cells = np.rint(u).astype(np.int64) * columns + np.rint(v).astype(np.int64)
        news = np.bincount(cells, observation.weights[rows], self.seen.size).reshape(
            self.seen.shape
        )
        seen = (1 - self.config.memory_fading) * self.seen + np.minimum(news, 1.0)
        return replace(self, seen=seen.astype(np.float32), scans=self.scans + 1)

    def retained_share(self, blurred: Float32, table: Float32) -> float:
        """Return the share of the reward of what was seen so far that a blurred table still gives."""
        sharp = float((self.seen * np.maximum(table, 0)).sum())
        return float((self.seen * np.maximum(blurred, 0)).sum()) / sharp if sharp > 0 else 1.0

    def rewards(self, sensor_xy_m: Float64, pose: Float64) -> Float32:
        """Return (U, V) what a point in each cell is worth at (3,) a pose, seen from (2,) a place."""
        sensor_m = into_frame(sensor_xy_m[None], pose)[0]
        u, v = self._axes_m()
        is_vehicle = self.size_m[1] >= self.config.vehicle_width_m
        reward = self._sides(u, v, sensor_m) if is_vehicle else self._middle(u, v, sensor_m)
        if self.scans:
            share = self.config.memory_share * self.scans / (self.scans + self.config.memory_scans)
            reward = (1 - share) * reward + share * self._motion()
        outside = (self.outside_m(u, v) - self.config.tolerance_m) / self.config.edge_m
        rim = np.clip(outside, 0.0, 1.0)
        reward = (1 - rim) * reward - rim * self.config.rim_penalty
        reward[[0, -1]] = 0.0  # what lies farther away says nothing
        reward[:, [0, -1]] = 0.0
        return reward.astype(np.float32)

    def _axes_m(self) -> tuple[Float64, Float64]:
        rows, columns = self.seen.shape
        u = (np.arange(rows) - (rows - 1) / 2) * self.config.cell_m
        v = (np.arange(columns) - (columns - 1) / 2) * self.config.cell_m
        return u[:, None], v[None]

    def _sides(self, u: Float64, v: Float64, sensor_m: Float64) -> Float64:
        """Reward what lies near the sides that face the sensor."""
        depths_m = []
        for position, size, sensor in zip((u, v), self.size_m[:2], sensor_m, strict=True):
            if abs(sensor) > size / 2:
                depths_m.append(size / 2 - np.sign(sensor) * position + 0 * u + 0 * v)
        depth_m = np.minimum.reduce(depths_m) if depths_m else np.zeros_like(u + v)
        near = np.exp(-0.5 * (depth_m / self.config.side_deviation_m) ** 2)
        deep = np.where(depth_m > 0, self.config.deep_reward, 0.0)
        return np.asarray(np.maximum(near, deep))

    def _middle(self, u: Float64, v: Float64, sensor_m: Float64) -> Float64:
        """Reward what lies near the middle of a body that does not fill its box."""
        sight_m = sensor_m / max(float(np.hypot(*sensor_m)), 1e-6)
        push_m = self.config.near_share * self.size_m[1] * sight_m
        spread_m = self.config.spread_share * self.size_m[:2]
        along, left = (u - push_m[0]) / spread_m[0], (v - push_m[1]) / spread_m[1]
        return np.asarray(np.exp(-0.5 * (along**2 + left**2)))

    def _motion(self) -> Float32:
        """Return how often each place was seen, against the places seen most."""
        smooth = cv2.GaussianBlur(self.seen, (0, 0), self.config.blur_m / self.config.cell_m)
        seen = smooth[smooth > 0.02]
        top = float(np.quantile(seen, 0.9)) if len(seen) else 1.0
        return np.asarray(np.minimum(smooth / top, 1.0))


def into_frame(points_xy_m: Float64, pose: Float64) -> Float64:
    """Return (N, 2) places along and left of (3,) a pose."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x, y = (points_xy_m - pose[:2]).T
    return np.column_stack([cos * x + sin * y, cos * y - sin * x])


def _clipped(value: float, bounds: tuple[float, float]) -> float:
    return float(np.clip(value, *bounds))
