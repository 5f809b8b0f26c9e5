"""2.5D motion grid: heights that the short-term map has neither in their cell nor near it (5.7)-(5.8)."""

from functools import cache

import cv2
import numpy as np

from perception.types import Float32, Int


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
