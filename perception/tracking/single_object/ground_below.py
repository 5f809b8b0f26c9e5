"""How high the ground lies below a followed object, near or far, with or without the ground stage."""

from dataclasses import dataclass

import numpy as np

from perception.types import Float64, GroundModel

_CELL_M = 0.5


@dataclass(frozen=True)
class GroundBelow:
    """The ground below an object in the world, which is as smooth as roads are.

    Attributes:
        z_world_m: its height.
        variance: of it.
    """

    z_world_m: float
    variance: float

    def moved(self, way_m: float) -> "GroundBelow":
        """Return what is known after the object went some way: roads rise and fall by some per cent."""
        return GroundBelow(self.z_world_m, self.variance + (0.03 * way_m) ** 2 + 0.01**2)

    def measured(self, z_world_m: float, deviation_m: float) -> "GroundBelow":
        """Take in one more height; one that is far off counts less."""
        off = z_world_m - self.z_world_m
        noise = deviation_m**2 * max(1.0, off**2 / (4 * (self.variance + deviation_m**2)))
        gain = self.variance / (self.variance + noise)
        return GroundBelow(self.z_world_m + gain * off, (1 - gain) * self.variance)


def lowest_around_m(points: Float64, expected_m: float, band_m: float) -> float | None:
    """Return the usual height of the lowest points of (N, 3), cell by cell, near what is expected."""
    cells = np.floor(points[:, :2] / _CELL_M).astype(np.int64)
    order = np.lexsort((points[:, 2], cells[:, 1], cells[:, 0]))
    cells, z = cells[order], points[order, 2]
    is_first = np.ones(len(z), bool)
    is_first[1:] = (cells[1:] != cells[:-1]).any(axis=1)
    low_m = z[is_first]
    low_m = low_m[np.abs(low_m - expected_m) < band_m]
    return float(np.median(low_m)) if len(low_m) >= 4 else None


def stage_height_m(
    ground: GroundModel | None, center_velo: Float64, local_m: float | None, trust_m: float
) -> float | None:
    """Return what the ground stage says below (3,) a place, unless the points around it speak against it.

    Beyond its area the stage's surface goes on as a plane, which may leave the road.
    """
    if ground is None:
        return None
    height_m = float(ground.height_m(center_velo[None, :2])[0])
    if not np.isfinite(height_m) or (local_m is not None and abs(height_m - local_m) > trust_m):
        return None
    return height_m
