"""Grids of moving objects by loops over their cells."""

import cv2
import numpy as np

from perception.datmo.cell_grid import CellGrid
from perception.datmo.config import MotionGridConfig
from perception.datmo.elevation import HIGH_M, LOW_M, MIN_RANGE_M, ElevationGrid
from perception.types import Float32, GroundModel


def elevation_by_loop(
    points_velo: Float32, ground: GroundModel, cells: CellGrid, config: MotionGridConfig
) -> ElevationGrid:
    """Sort the points into cells one by one, then look at each cell's heights (5.6)."""
    heights_m: dict[tuple[int, int], list[float]] = {}
    for point, height_m in zip(points_velo, ground.distance_m(points_velo), strict=True):
        x, y = point[:2]
        inside = cells.low_m[0] <= x < cells.high_m[0] and cells.low_m[1] <= y < cells.high_m[1]
        far = np.hypot(x, y) > MIN_RANGE_M
        if inside and far and LOW_M < height_m < HIGH_M:
            row, column = np.floor((point[:2] - cells.low_m) / cells.cell_m).astype(int)
            heights_m.setdefault((row, column), []).append(float(height_m))
    grid = ElevationGrid(np.zeros(cells.shape, np.float32), np.zeros(cells.shape, np.int64))
    for cell, values in heights_m.items():
        grid.points[cell] = len(values)
        variance_m2 = np.var(values, ddof=1) if len(values) > 1 else 0.0
        statistic_m = np.mean(values) if config.ground_statistic == "mean" else max(values)
        if variance_m2 >= config.ground_variance_m2 or statistic_m >= config.ground_height_m:
            grid.height_m[cell] = np.mean(values)
    return grid


def motion_by_windows(
    height_m: Float32, background_m: Float32, alpha: float, radius_cells: int
) -> Float32:
    """Compare each cell with its whole neighbourhood in the map (5.7)-(5.8)."""
    motion_m = np.zeros_like(height_m)
    for i, j in np.argwhere(height_m > 0):
        nearby_m = background_m[
            max(i - radius_cells, 0) : i + radius_cells + 1,
            max(j - radius_cells, 0) : j + radius_cells + 1,
        ]
        difference_m = np.abs(height_m[i, j] - nearby_m).min()
        if difference_m > np.float32(alpha) * height_m[i, j]:
            motion_m[i, j] = height_m[i, j]
    return motion_m


def fill_holes_by_flooding(grid: Float32) -> Float32:
    """Raise every pit to the lowest level over which it would drain to the border.

    Water covers everything and sinks, a cell a step, as far as it can drain.
    """
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    level = np.full(grid.shape, np.inf, np.float32)
    level[[0, -1]], level[:, [0, -1]] = grid[[0, -1]], grid[:, [0, -1]]
    while True:
        lower = np.maximum(cv2.erode(level, cross), grid)
        if np.array_equal(lower, level):
            return level
        level = lower
