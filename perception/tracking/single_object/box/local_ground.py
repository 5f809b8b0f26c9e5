"""How high the ground lies below a followed object, near or far, with or without the ground stage."""

from dataclasses import dataclass

import numpy as np

from perception.geometry.se3 import inverse
from perception.tracking.single_object.tracker import TrackerInput
from perception.types import Float64, GroundModel

_CELL_M = 0.5  # the lowest point of each cell may be ground
_MIN_CELLS = 4
_AROUND_M = 2.5  # beyond the object
_BAND_M = 0.4  # around what is expected
_TRUST_M = 0.2  # between the stage and the points around the object
_SLOPE = 0.03  # by which a road rises or falls, one deviation
_DRIFT_M = 0.01  # a scan, of poses
_STAGE_M, _LOCAL_M = 0.05, 0.15  # deviations of both heights
_ABOVE_M = 0.03  # the usual lowest point of a cell lies so far over the ground


@dataclass(frozen=True)
class LocalGround:
    """The ground below an object in the world, which is as smooth as roads are.

    Attributes:
        z_world_m: its height.
        variance: of it.
    """

    z_world_m: float
    variance: float

    @classmethod
    def of_box(cls, bottom_m: float) -> "LocalGround":
        """Return the ground that the first box stands on."""
        return cls(bottom_m, _STAGE_M**2)

    def moved(self, travelled_m: float) -> "LocalGround":
        """Return what is known after the object went some way."""
        return LocalGround(
            self.z_world_m, self.variance + (_SLOPE * travelled_m) ** 2 + _DRIFT_M**2
        )

    def measured(self, z_world_m: float, deviation_m: float) -> "LocalGround":
        """Take in one more height; one that is far off counts less."""
        off = z_world_m - self.z_world_m
        noise = deviation_m**2 * max(1.0, off**2 / (4 * (self.variance + deviation_m**2)))
        gain = self.variance / (self.variance + noise)
        return LocalGround(self.z_world_m + gain * off, (1 - gain) * self.variance)


def update_ground(
    ground: LocalGround,
    position_world: Float64,
    length_m: float,
    tracker_input: TrackerInput,
    around_world: Float64,
) -> LocalGround:
    """Return the ground after a scan, by the ground stage, else by the lowest points around the object.

    Args:
        ground: as expected.
        position_world: (3,) the middle of the object's bottom.
        length_m: of the object.
        tracker_input: with the ground of the stage, or without.
        around_world: (N, 3) points around the object.
    """
    x, y = np.abs(around_world[:, :2].T - position_world[:2, None])
    reach_m = length_m / 2 + _AROUND_M
    is_low = around_world[:, 2] < ground.z_world_m + _BAND_M
    local_m = _lowest_m(around_world[is_low & (x < reach_m) & (y < reach_m)], ground.z_world_m)
    velo = inverse(tracker_input.world_SE3_velo)
    position_velo = velo[:3, :3] @ position_world + velo[:3, 3]
    stage_m = _stage_m(tracker_input.ground, position_velo)
    if stage_m is not None:
        stage_m += position_world[2] - position_velo[2]
        # Beyond its area the stage's surface goes on as a plane, which may leave the road.
        if local_m is None or abs(stage_m - local_m) < _TRUST_M:
            return ground.measured(stage_m, _STAGE_M)
    return ground if local_m is None else ground.measured(local_m - _ABOVE_M, _LOCAL_M)


def _stage_m(ground: GroundModel | None, position_velo: Float64) -> float | None:
    if ground is None:
        return None
    height_m = float(ground.height_m(position_velo[None, :2])[0])
    return height_m if np.isfinite(height_m) else None


def _lowest_m(points: Float64, expected_m: float) -> float | None:
    """Return the usual height of the lowest points of (N, 3), cell by cell, near what is expected."""
    if len(points) == 0:
        return None
    cells = np.floor(points[:, :2] / _CELL_M).astype(np.int64)
    cells -= cells.min(axis=0)
    keys = cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1]
    order = np.argsort(keys)
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    low_m = np.minimum.reduceat(points[order, 2], starts)
    low_m = low_m[np.abs(low_m - expected_m) < _BAND_M]
    return float(np.median(low_m)) if len(low_m) >= _MIN_CELLS else None
