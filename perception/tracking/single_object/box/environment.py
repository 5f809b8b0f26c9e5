"""Environment of a tracked object: the height of the ground below it, and the background around it."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from perception.geometry.se3 import inverse
from perception.tracking.single_object.box.observation import cell_groups
from perception.tracking.single_object.tracker import TrackerInput
from perception.types import Bool, Float64, GroundModel

_GROUND_CELL_M = 0.5  # edge of the cells of the lowest points
_MIN_CELLS = 4  # minimum number of cells with a lowest point near the expected height
_AROUND_M = 2.5  # distance from the object within which lowest points are used
_BAND_M = 0.4  # maximum difference of a lowest point from the expected height
_MAX_DISAGREEMENT_M = 0.2  # of ground stage and lowest points where the stage is used
_SLOPE = 0.03  # standard deviation of the road's slope
_DRIFT_M = 0.01  # standard deviation of the drift of the poses per scan
_STAGE_DEVIATION_M = 0.05  # standard deviation of a height from the ground stage
_LOWEST_DEVIATION_M = 0.15  # standard deviation of a height from the lowest points
_LOWEST_ABOVE_M = 0.03  # mean height of the lowest points above the ground

_BACKGROUND_CELL_M = 0.15  # edge of the cells of the background
_RECENT = 4  # number of scans whose points beside the observed object are background
_KEPT = 10  # number of scans that are remembered
_MIN_HIDDEN = 6  # minimum number of scans with a hidden object before static points are background
_STATIC_SHARE = 0.7  # share of these scans in which a static point is observed


@dataclass(frozen=True)
class LocalGround:
    """Height of the ground below an object in the world, as smooth as roads are.

    Attributes:
        z_world_m: Height.
        variance: Variance of the height, in m².
    """

    z_world_m: float
    variance: float

    @classmethod
    def below_box(cls, bottom_m: float) -> "LocalGround":
        """Return the ground that the initial box stands on."""
        return cls(bottom_m, _STAGE_DEVIATION_M**2)

    def moved(self, travelled_m: float) -> "LocalGround":
        """Return the ground after the object has travelled."""
        variance = self.variance + (_SLOPE * travelled_m) ** 2 + _DRIFT_M**2
        return replace(self, variance=variance)

    def measured(self, z_world_m: float, deviation_m: float) -> "LocalGround":
        """Correct the height by one more measurement; an outlier counts less."""
        off = z_world_m - self.z_world_m
        noise = deviation_m**2 * max(1.0, off**2 / (4 * (self.variance + deviation_m**2)))
        gain = self.variance / (self.variance + noise)
        z_world_m, variance = self.z_world_m + gain * off, (1 - gain) * self.variance
        return replace(self, z_world_m=z_world_m, variance=variance)

    def updated(
        self,
        tracker_input: TrackerInput,
        position_world: Float64,
        length_m: float,
        around_world: Float64,
    ) -> "LocalGround":
        """Return the ground after a scan, from the ground stage or from the lowest points around the object.

        Args:
            tracker_input: Frame, with or without the ground model of the ground stage.
            position_world: (3,) bottom centre of the object.
            length_m: Length of the object.
            around_world: (N, 3) points around the object.
        """
        x, y = np.abs(around_world[:, :2].T - position_world[:2, None])
        reach_m = length_m / 2 + _AROUND_M
        is_low = around_world[:, 2] < self.z_world_m + _BAND_M
        near_world = around_world[is_low & (x < reach_m) & (y < reach_m)]
        lowest_m = _median_lowest_m(near_world, self.z_world_m)
        velo_SE3_world = inverse(tracker_input.world_SE3_velo)
        position_velo = velo_SE3_world[:3, :3] @ position_world + velo_SE3_world[:3, 3]
        stage_m = _stage_height_m(tracker_input.ground, position_velo)
        if stage_m is not None:
            stage_m += position_world[2] - position_velo[2]
            # Beyond its area the stage's surface is extended as a plane, which may leave the road.
            if lowest_m is None or abs(stage_m - lowest_m) < _MAX_DISAGREEMENT_M:
                return self.measured(stage_m, _STAGE_DEVIATION_M)
        if lowest_m is None:
            return self
        return self.measured(lowest_m - _LOWEST_ABOVE_M, _LOWEST_DEVIATION_M)


def _stage_height_m(ground: GroundModel | None, position_velo: Float64) -> float | None:
    if ground is None:
        return None
    height_m = float(ground.height_m(position_velo[None, :2])[0])
    return height_m if np.isfinite(height_m) else None


def _median_lowest_m(points: Float64, expected_m: float) -> float | None:
    """Return the median of the lowest heights of (N, 3) points, cell by cell, near an expected height."""
    if len(points) == 0:
        return None
    order, starts = cell_groups(points, _GROUND_CELL_M)
    low_m = np.minimum.reduceat(points[order, 2], starts)
    low_m = low_m[np.abs(low_m - expected_m) < _BAND_M]
    return float(np.median(low_m)) if len(low_m) >= _MIN_CELLS else None


@dataclass(frozen=True)
class _BackgroundScan:
    """The (N, 2) points in the world that one scan showed beside the object; all, where it was hidden."""

    points_xy_m: Float64
    is_hidden: bool


@dataclass(frozen=True)
class BackgroundModel:
    """Points of the last scans that are not the object's.

    While the object is observed, every point beside it is background at once. While it is hidden it may be among
    them, and only points that stay are background.

    Attributes:
        scans: Last scans without the object, newest first.
    """

    scans: tuple[_BackgroundScan, ...] = ()

    def updated(self, points_xy_m: Float64, *, is_hidden: bool) -> "BackgroundModel":
        """Return the background after one more scan."""
        scans = (_BackgroundScan(points_xy_m, is_hidden), *self.scans)[:_KEPT]
        return replace(self, scans=scans)

    def contains(self, points_xy_m: Float64) -> Bool:
        """Return whether each of (N, 2) points lies on the background."""
        if not self.scans or not len(points_xy_m):
            return np.zeros(len(points_xy_m), bool)
        low_m = points_xy_m.min(axis=0) - 2 * _BACKGROUND_CELL_M
        shape = tuple(
            np.floor((points_xy_m.max(axis=0) - low_m) / _BACKGROUND_CELL_M).astype(int) + 3
        )
        own = np.floor((points_xy_m - low_m) / _BACKGROUND_CELL_M).astype(np.int64)
        recent = [scan for scan in self.scans[:_RECENT] if not scan.is_hidden]
        is_background = self._count(recent, low_m, shape)[own[:, 0], own[:, 1]] > 0
        hidden = [scan for scan in self.scans if scan.is_hidden]
        if len(hidden) >= _MIN_HIDDEN:
            counts = self._count(hidden, low_m, shape)[own[:, 0], own[:, 1]]
            is_background |= counts >= _STATIC_SHARE * len(hidden)
        return np.asarray(is_background)

    @staticmethod
    def _count(scans: list[_BackgroundScan], low_m: Float64, shape: tuple[int, ...]) -> Float64:
        """Return the number of scans with a point in or beside each cell."""
        counts = np.zeros(shape)
        for scan in scans:
            cells = np.floor((scan.points_xy_m - low_m) / _BACKGROUND_CELL_M).astype(np.int64)
            cells = cells[((cells >= 0) & (cells < shape)).all(axis=1)]
            occupied = np.zeros(shape, np.uint8)
            occupied[cells[:, 0], cells[:, 1]] = 1
            counts += cv2.dilate(occupied, np.ones((3, 3), np.uint8))
        return counts
