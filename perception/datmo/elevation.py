"""Local elevation grid: the height of each cell above the ground (5.6)."""

from dataclasses import dataclass

import cv2
import numpy as np

from perception.datmo.cell_grid import CellGrid
from perception.datmo.config import MotionGridConfig
from perception.types import Bool, Float, Float32, Float64, GroundModel, Int

# Points that count, by the author's code: over the ground, and horizontally from the LiDAR.
LOW_M, HIGH_M, MIN_RANGE_M = -1.0, 2.5, 3.0


@dataclass(frozen=True)
class ElevationGrid:
    """Heights and points of each cell in one scan.

    Attributes:
        height_m: (X, Y) mean height of the points of a cell; 0 where it is ground or was not observed.
        points: (X, Y) number of points in the cell.
    """

    height_m: Float32
    points: Int

    @property
    def is_observed(self) -> Bool:
        """(X, Y) whether any point fell into the cell; the ground counts, with height 0."""
        return np.asarray(self.points > 0)


@dataclass(frozen=True)
class LevelPlane:
    """Ground of the thesis' grids: a level plane below the LiDAR by its mounting height.

    Attributes:
        z_m: Height of the plane in the LiDAR frame in metres.
    """

    z_m: float

    def height_m(self, xy_m: Float) -> Float64:
        """Return (N,) the same z for all (N, 2) positions."""
        return np.full(len(xy_m), self.z_m)

    def distance_m(self, points_velo: Float) -> Float:
        """Return (N,) heights of (N, 3+) points over the plane."""
        return np.asarray(points_velo[:, 2] - points_velo.dtype.type(self.z_m))


def elevation_grid(
    points_velo: Float32, ground: GroundModel, cells: CellGrid, config: MotionGridConfig
) -> ElevationGrid:
    """Build the elevation grid of a scan, heights measured over the given ground (5.6)."""
    points = _over_cells(points_velo, cells)
    height_m = ground.distance_m(points)
    cell_of = _cell_of(points, cells)
    size = cells.shape[0] * cells.shape[1]
    cell_of[_left_out(points, height_m)] = size  # a cell beyond the last
    height_m = height_m.astype(np.float64)  # once, not in every count

    seen = np.bincount(cell_of, minlength=size + 1)[:size]
    sum_m = np.bincount(cell_of, height_m, size + 1)[:size]
    mean_m = sum_m / np.maximum(seen, 1)
    sum_m2 = np.bincount(cell_of, height_m**2, size + 1)[:size]
    # The sample variance; that of a single point is taken as 0.
    variance_m2 = (sum_m2 - sum_m * mean_m) / np.maximum(seen - 1, 1)
    if config.ground_statistic == "mean":
        is_low = mean_m < config.ground_height_m
    else:
        # The highest point lies lower than the threshold: none reaches it.
        tall = cell_of[height_m >= config.ground_height_m]
        is_low = np.bincount(tall, minlength=size + 1)[:size] == 0
    is_ground = (variance_m2 < config.ground_variance_m2) & is_low
    object_m = np.where(is_ground, 0, mean_m).astype(np.float32)
    return ElevationGrid(object_m.reshape(cells.shape), seen.reshape(cells.shape))


def _over_cells(points_velo: Float32, cells: CellGrid) -> Float32:
    """Return the points over the cells; those at the far edges, which rounding would put outside, are left out."""
    if len(points_velo) == 0:
        return points_velo
    hair_m = 1e-4 * cells.cell_m
    anything = float(np.finfo(np.float32).max)
    low = (*cells.low_m, -anything, -anything)
    high = (cells.high_m[0] - hair_m, cells.high_m[1] - hair_m, anything, anything)
    # One pass over all columns, five times as fast as a comparison for each side.
    is_over = cv2.inRange(np.ascontiguousarray(points_velo)[None], low, high)
    return points_velo.take(np.flatnonzero(is_over), axis=0)


def _cell_of(points: Float32, cells: CellGrid) -> Int:
    """Return (N,) the flat number of each point's cell."""
    indices = []
    for axis in (0, 1):
        place = points[:, axis] - np.float32(cells.low_m[axis])
        place *= np.float32(1 / cells.cell_m)
        indices.append(place.astype(np.int32))
    return np.asarray(indices[0] * cells.shape[1] + indices[1], np.intp)


def _left_out(points: Float32, height_m: Float) -> Int:
    """Return the rows of the points that do not count."""
    squared_m2 = points[:, 0] ** 2 + points[:, 1] ** 2
    is_left_out = squared_m2 <= MIN_RANGE_M**2
    is_left_out |= (height_m <= LOW_M) | (height_m >= HIGH_M)
    return np.flatnonzero(is_left_out)
