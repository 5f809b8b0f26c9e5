"""Environment of a tracked object: the height of the ground below it, and the background around it."""

from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from perception.geometry.se3 import inverse
from perception.tracking.single_object.config import BackgroundConfig, LocalGroundConfig
from perception.tracking.single_object.tracker import TrackerInput
from perception.types import Bool, Float64, GroundModel


@dataclass(frozen=True)
class LocalGround:
    """Height of the ground below an object in the world, as smooth as roads are.

    Attributes:
        z_world_m: Height.
        variance: Variance of the height, in m².
        config: Cells, distances and deviations.
    """

    z_world_m: float
    variance: float
    config: LocalGroundConfig = field(default_factory=LocalGroundConfig)

    @classmethod
    def below_box(cls, bottom_m: float, config: LocalGroundConfig) -> "LocalGround":
        """Return the ground that the initial box stands on."""
        return cls(bottom_m, config.stage_deviation_m**2, config)

    def moved(self, travelled_m: float) -> "LocalGround":
        """Return the ground after the object has travelled."""
        variance = self.variance + (self.config.slope * travelled_m) ** 2 + self.config.drift_m**2
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
        config = self.config
        x, y = np.abs(around_world[:, :2].T - position_world[:2, None])
        reach_m = length_m / 2 + config.around_m
        is_low = around_world[:, 2] < self.z_world_m + config.band_m
        near_world = around_world[is_low & (x < reach_m) & (y < reach_m)]
        lowest_m = _median_lowest_m(near_world, self.z_world_m, config)
        velo_SE3_world = inverse(tracker_input.world_SE3_velo)
        position_velo = velo_SE3_world[:3, :3] @ position_world + velo_SE3_world[:3, 3]
        stage_m = _stage_height_m(tracker_input.ground, position_velo)
        if stage_m is not None:
            stage_m += position_world[2] - position_velo[2]
            # Beyond its area the stage's surface is extended as a plane, which may leave the road.
            if lowest_m is None or abs(stage_m - lowest_m) < config.max_disagreement_m:
                return self.measured(stage_m, config.stage_deviation_m)
        if lowest_m is None:
            return self
        return self.measured(lowest_m - config.lowest_above_m, config.lowest_deviation_m)


def _stage_height_m(ground: GroundModel | None, position_velo: Float64) -> float | None:
    if ground is None:
        return None
    height_m = float(ground.height_m(position_velo[None, :2])[0])
    return height_m if np.isfinite(height_m) else None


def _median_lowest_m(points: Float64, expected_m: float, config: LocalGroundConfig) -> float | None:
    """Return the median of the lowest heights of (N, 3) points, cell by cell, near an expected height."""
    if len(points) == 0:
        return None
    cells = np.floor(points[:, :2] / config.cell_m).astype(np.int64)
    cells -= cells.min(axis=0)
    keys = cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1]
    order = np.argsort(keys)
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    low_m = np.minimum.reduceat(points[order, 2], starts)
    low_m = low_m[np.abs(low_m - expected_m) < config.band_m]
    return float(np.median(low_m)) if len(low_m) >= config.min_cells else None


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
        config: Cells and numbers of scans.
        scans: Last scans without the object, newest first.
    """

    config: BackgroundConfig = field(default_factory=BackgroundConfig)
    scans: tuple[_BackgroundScan, ...] = ()

    def updated(self, points_xy_m: Float64, *, is_hidden: bool) -> "BackgroundModel":
        """Return the background after one more scan."""
        scans = (_BackgroundScan(points_xy_m, is_hidden), *self.scans)[: self.config.kept]
        return replace(self, scans=scans)

    def contains(self, points_xy_m: Float64) -> Bool:
        """Return whether each of (N, 2) points lies on the background."""
        if not self.scans or not len(points_xy_m):
            return np.zeros(len(points_xy_m), bool)
        config = self.config
        low_m = points_xy_m.min(axis=0) - 2 * config.cell_m
        shape = tuple(np.floor((points_xy_m.max(axis=0) - low_m) / config.cell_m).astype(int) + 3)
        own = np.floor((points_xy_m - low_m) / config.cell_m).astype(np.int64)
        recent = [scan for scan in self.scans[: config.recent] if not scan.is_hidden]
        is_background = self._count(recent, low_m, shape)[own[:, 0], own[:, 1]] > 0
        hidden = [scan for scan in self.scans if scan.is_hidden]
        if len(hidden) >= config.min_hidden:
            counts = self._count(hidden, low_m, shape)[own[:, 0], own[:, 1]]
            is_background |= counts >= config.static_share * len(hidden)
        return np.asarray(is_background)

    def _count(
        self, scans: list[_BackgroundScan], low_m: Float64, shape: tuple[int, ...]
    ) -> Float64:
        """Return the number of scans with a point in or beside each cell."""
        counts = np.zeros(shape)
        for scan in scans:
            cells = np.floor((scan.points_xy_m - low_m) / self.config.cell_m).astype(np.int64)
            cells = cells[((cells >= 0) & (cells < shape)).all(axis=1)]
            occupied = np.zeros(shape, np.uint8)
            occupied[cells[:, 0], cells[:, 1]] = 1
            counts += cv2.dilate(occupied, np.ones((3, 3), np.uint8))
        return counts
