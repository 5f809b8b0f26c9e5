"""Objects in a motion grid: morphology, hole filling, size filters and labels (5.9)."""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from perception.datmo.config import MotionGridConfig
from perception.types import Bool, Float32, Int

# Table 7.4 gives none of these values; they are those of the author's code.
_LONG_CELLS, _SHORT_CELLS = 10, 2  # sides of the structuring elements s_x and s_y
_MIN_PRODUCT_M2 = 0.5  # of the two dilated heights of a cell in the core of an object
_MIN_MOVING_AREA_M2 = 0.5  # of the moving cells of an object
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


def motion_grid(
    height_m: Float32, background_m: Float32, alpha: float, radius_cells: int
) -> Float32:
    """Keep the heights that no cell of the short-term map nearby explains.

    A height is explained by one that differs from it by at most T_e = alpha times itself. Only cells above the ground
    are searched, ring by ring, as long as they are unexplained: most are explained at once. A radius of 0 is
    subtraction.

    Args:
        height_m: (X, Y) the newest elevation grid E.
        background_m: (X, Y) the short-term map S.
        alpha: Share of its height by which a cell may differ from the map (α).
        radius_cells: Radius in cells of the square neighbourhood J (ε).

    Returns:
        (X, Y) M: the height where something moves, else 0.
    """
    # Beyond the grid lies nothing that could explain a height.
    padded_m = cv2.copyMakeBorder(
        background_m, *(radius_cells,) * 4, cv2.BORDER_CONSTANT, value=np.inf
    )
    width = padded_m.shape[1]
    nearby_m = padded_m.ravel()
    rows, columns = np.nonzero(height_m > 0)
    above_ground_m = height_m[rows, columns]
    center = (rows + radius_cells) * width + columns + radius_cells
    open_m, limit_m = above_ground_m, np.float32(alpha) * above_ground_m
    unexplained = np.arange(len(above_ground_m))
    for radius in range(radius_cells + 1):
        around = nearby_m.take(center[None] + _ring(radius, width)[:, None])
        stays = (np.abs(around - open_m) > limit_m).all(axis=0)
        center, open_m, limit_m = center[stays], open_m[stays], limit_m[stays]
        unexplained = unexplained[stays]
    motion_m = np.zeros_like(height_m)
    motion_m[rows[unexplained], columns[unexplained]] = above_ground_m[unexplained]
    return motion_m


@cache
def _ring(radius: int, width: int) -> Int:
    """Return the flat offsets of the cells at this Chebyshev distance."""
    row, column = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    on_ring = np.maximum(np.abs(row), np.abs(column)) == radius
    return np.asarray(row[on_ring] * width + column[on_ring])


@dataclass(frozen=True)
class LabelledCells:
    """Objects of a motion grid.

    Attributes:
        labels: (X, Y) object of each cell, 1 to `count`; 0 where there is none.
        count: Number of objects.
        joined: (X, Y) cells after morphology, before the size filters.
    """

    labels: Int
    count: int
    joined: Bool


def find_objects(motion_m: Float32, config: MotionGridConfig) -> LabelledCells:
    """Join the moving cells of an (X, Y) motion grid to objects of a plausible size."""
    joined = join_cells(motion_m)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        joined.astype(np.uint8), connectivity=8, ltype=cv2.CV_32S
    )
    moving = np.bincount(labels[motion_m > 0], minlength=count)
    area = stats[:, cv2.CC_STAT_AREA]
    cell_m2 = config.cell_m**2
    is_kept = (
        (moving >= np.ceil(_whole(_MIN_MOVING_AREA_M2 / cell_m2)))
        & (area >= np.floor(_whole(config.min_area_m2 / cell_m2)))
        & (area <= np.floor(_whole(config.max_area_m2 / cell_m2)))
    )
    is_kept[0] = False  # the background
    number = np.where(is_kept, np.cumsum(is_kept), 0)
    return LabelledCells(number[labels], int(is_kept.sum()), joined)


def join_cells(motion_m: Float32) -> Bool:
    """Return which cells belong to objects: O = (M ⊕ s_x) ∧ (M ⊕ s_y) (5.9), and the steps of the author's code.

    The rows of the grid run along x, ahead. Dilated there once more, a vehicle that the beams cut into
    pieces is whole; both dilations also lengthen what they join.
    """
    along = fill_holes(_dilate(motion_m, _LONG_CELLS, _SHORT_CELLS))
    across = fill_holes(_dilate(motion_m, _SHORT_CELLS, _LONG_CELLS))
    joined = fill_holes(_dilate(along * across, _LONG_CELLS, 1))
    # Erosion by a ball of radius 1 cell keeps cells that are higher than the ball and have four neighbours
    # above zero.
    core = cv2.erode(
        (joined > 0).astype(np.uint8), _CROSS, borderType=cv2.BORDER_CONSTANT, borderValue=1
    )
    return np.asarray((core > 0) & (joined > _MIN_PRODUCT_M2))


def _dilate(grid: Float32, rows: int, columns: int) -> Float32:
    """Spread the highest values over a rectangle of cells."""
    return np.asarray(cv2.dilate(grid, np.ones((rows, columns), np.uint8)), np.float32)


def fill_holes(grid: Float32) -> Float32:
    """Raise every pit of (X, Y) heights to the lowest level over which it would drain to the border.

    The level starts high over all cells above 0 and sinks, one cell a step, until nothing drains any more. Open
    ground starts at 0, so the widest object determines the number of steps.
    """
    padded = cv2.copyMakeBorder(grid, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    is_high = (padded > 0).astype(np.uint8)
    cv2.floodFill(is_high, None, (0, 0), 2)
    level = np.where(is_high == 2, np.float32(0), padded.max())
    while True:
        lower = np.asarray(cv2.max(cv2.erode(level, _CROSS), padded), np.float32)
        if np.array_equal(lower, level):
            return lower[1:-1, 1:-1].copy()
        level = lower


def _whole(cells: float) -> float:
    """Return a number of cells without the last digits that a division leaves."""
    return round(cells, 6)
