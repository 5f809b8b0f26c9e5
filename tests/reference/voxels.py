"""Voxels and counters by loops over their cells."""

import numpy as np

from perception.types import Bool, Float, Float32, Float64, Int, Voxels


def count_voxels_by_loop(points: Float, size_m: float) -> Voxels:
    """Count occupied voxels in a dictionary, one point after the other."""
    counts: dict[tuple[int, ...], int] = {}
    for point in points[:, :3].astype(np.float64):
        index = tuple(int(cell) for cell in np.floor(point / size_m))
        counts[index] = counts.get(index, 0) + 1
    occupied = sorted(counts)
    centers: Float32 = ((np.array(occupied).reshape(-1, 3) + 0.5) * size_m).astype(np.float32)
    return Voxels(centers, np.array([counts[index] for index in occupied]), size_m)


def subtract_dense(merged: Int, scans: list[Int]) -> tuple[Int, Int]:
    """Filter the merged grid D, then the newest scan's grid P_i (5.1.3, preprocessing).

    Args:
        merged: (X, Y, Z) occupancy of all scans together.
        scans: (X, Y, Z) occupancy of each scan, the newest last.

    Returns:
        D without the voxels that one scan alone filled, and P_i without the voxels left in D.
    """
    static = merged.copy()
    for scan in reversed(scans):
        static[static <= scan] = 0
    return static, np.where(scans[-1] > static, scans[-1], 0)


def count_columns_by_loop(grid: Int) -> Int:
    """Sum occupancy over height (5.3)."""
    counter = np.zeros(grid.shape[:2], np.int64)
    for i in range(grid.shape[0]):
        for j in range(grid.shape[1]):
            for k in range(grid.shape[2]):
                counter[i, j] += grid[i, j, k]
    return counter


def log_ratio_by_loop(moving: Int, static: Int, min_count: float = 1.0) -> Float64:
    """Take the log-likelihood ratio of two counters, cell by cell (5.4)."""
    ratio = np.zeros(moving.shape)
    for i, j in np.ndindex(*moving.shape):
        ratio[i, j] = np.log(max(moving[i, j], min_count) / max(static[i, j], min_count))
    return ratio


def masks_by_loop(
    static: Int, moving: Int, static_points: int, moving_points: int
) -> tuple[Bool, Bool]:
    """Decide which columns are static and which move, cell by cell (5.5)."""
    is_static, is_moving = np.zeros(static.shape, bool), np.zeros(static.shape, bool)
    for cell in np.ndindex(*static.shape):
        s, d = static[cell], moving[cell]
        is_static[cell] = s >= static_points and s > (d if d >= moving_points else 1)
        is_moving[cell] = d >= moving_points and d > (s if s >= moving_points else 1)
    return is_static, is_moving
