"""Voxels by their keys: keys of moved points, and two sets of voxels as one."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled
from perception.types import Bool, Float32, Float64, Int

_POINTS, _KEYS = array_of(np.float32, 2), array_of(np.int64)


@compiled((_POINTS, array_of(np.float64, 2), array_of(np.float64), NUMBER, (WHOLE, WHOLE, WHOLE)))
def keys_of_moved(
    points: Float32,
    grid_SE3_points: Float64,
    corner_m: Float64,
    size_m: float,
    shape: tuple[int, int, int],
) -> Int:
    """Return the (N,) key of the cell that holds each of (N, 3+) points after a motion; those beyond go to the border.

    Args:
        points: (N, 3+) points.
        grid_SE3_points: (4, 4) transform from the points to the frame of the grid.
        corner_m: (3,) corner of the grid.
        size_m: Edge of a cell in metres.
        shape: Number of cells along x, y and z.
    """
    T, keys = grid_SE3_points, np.zeros(len(points), np.int64)
    for axis in range(3):
        last = shape[axis] - 1
        for row in range(len(points)):
            x, y, z = points[row, 0], points[row, 1], points[row, 2]
            along_m = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z + T[axis, 3]
            cell = int(np.floor((along_m - corner_m[axis]) / size_m))
            keys[row] = keys[row] * shape[axis] + min(max(cell, 0), last)
    return keys


@compiled((_KEYS, _KEYS, _KEYS, _POINTS, array_of(np.bool_), _KEYS, _KEYS, _POINTS))
def merge_voxels(
    keys: Int,
    counts: Int,
    ages: Int,
    centers: Float32,
    stays: Bool,
    new_keys: Int,
    new_counts: Int,
    new_centers: Float32,
) -> tuple[Int, Int, Int, Float32]:
    """Return those of K voxels that stay, and V new ones, by rising key; counts of a key in both add up.

    Args:
        keys: (K,) rising keys.
        counts: (K,) points of each.
        ages: (K,) scans since each was observed; one more in what is returned, 0 for new voxels.
        centers: (K, 3) their centres, which stay where both have one.
        stays: (K,) which of them stay.
        new_keys: (V,) rising keys.
        new_counts: (V,) points of each.
        new_centers: (V, 3) their centres.
    """
    size = len(keys) + len(new_keys)
    all_keys, all_counts = np.empty(size, np.int64), np.empty(size, np.int64)
    all_ages, all_centers = np.zeros(size, np.int64), np.empty((size, 3), np.float32)
    found, old, new = 0, 0, 0
    while old < len(keys) or new < len(new_keys):
        if old < len(keys) and not stays[old]:
            old += 1
            continue
        takes_old = old < len(keys) and (new == len(new_keys) or keys[old] <= new_keys[new])
        takes_new = new < len(new_keys) and (old == len(keys) or new_keys[new] <= keys[old])
        all_counts[found] = 0
        if takes_new:
            all_keys[found], all_counts[found] = new_keys[new], new_counts[new]
            for axis in range(3):
                all_centers[found, axis] = new_centers[new, axis]
            new += 1
        if takes_old:
            all_keys[found] = keys[old]
            all_counts[found] += counts[old]
            if not takes_new:
                all_ages[found] = ages[old] + 1
            for axis in range(3):
                all_centers[found, axis] = centers[old, axis]
            old += 1
        found += 1
    return all_keys[:found], all_counts[:found], all_ages[:found], all_centers[:found]
