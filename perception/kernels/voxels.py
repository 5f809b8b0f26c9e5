"""Voxels by their keys: groups of moved points, centres, those that stay in a memory, and two sets of voxels as one."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled
from perception.kernels.sorting import sorted_by_digits
from perception.types import Bool, Float32, Float64, Int

_POINTS, _KEYS = array_of(np.float32, 2), array_of(np.int64)
_RECTANGLE = (np.float32, np.float32, np.float32, np.float32)


@compiled((_POINTS, array_of(np.float64, 2), array_of(np.float64), NUMBER, (WHOLE, WHOLE, WHOLE)))
def cells_of_moved(
    points: Float32,
    grid_SE3_points: Float64,
    corner_m: Float64,
    size_m: float,
    shape: tuple[int, int, int],
) -> tuple[Int, Int, Int, Int]:
    """Group (N, 3+) points by the cell that holds them after a motion; those beyond go to the border.

    Args:
        points: (N, 3+) points, at least one.
        grid_SE3_points: (4, 4) transform from the points to the frame of the grid.
        corner_m: (3,) corner of the grid.
        size_m: Edge of a cell in metres.
        shape: Number of cells along x, y and z.

    Returns:
        (K,) keys of the cells with points, rising; (K,) numbers of their points; (K,) the first point of each; (N,) the
        cell of each point, 0 to K - 1.
    """
    T, count = grid_SE3_points, len(points)
    cells = np.empty((3, count), np.int64)
    # Numbers of cells from the lowest of all: fewer digits than the keys, in the same order.
    order_keys = np.zeros(count, np.int64)
    for axis in range(3):
        last = shape[axis] - 1
        low, high = shape[axis], -1
        for row in range(count):
            x, y, z = points[row, 0], points[row, 1], points[row, 2]
            along_m = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z + T[axis, 3]
            cell = int(np.floor((along_m - corner_m[axis]) / size_m))
            cell = min(max(cell, 0), last)
            cells[axis, row] = cell
            low, high = min(low, cell), max(high, cell)
        for row in range(count):
            order_keys[row] = order_keys[row] * (high - low + 1) + cells[axis, row] - low
    ordered, order = sorted_by_digits(order_keys)
    keys, counts = np.empty(count, np.int64), np.zeros(count, np.int64)
    first, group_of, found = np.empty(count, np.int64), np.empty(count, np.int64), -1
    for k in range(count):
        row = order[k]
        if k == 0 or ordered[k] != ordered[k - 1]:
            found += 1
            bar = cells[0, row] * shape[1] + cells[1, row]
            keys[found], first[found] = bar * shape[2] + cells[2, row], row
        counts[found] += 1
        group_of[row] = found
    return keys[: found + 1], counts[: found + 1], first[: found + 1], group_of


@compiled((_KEYS, (WHOLE, WHOLE, WHOLE), array_of(np.float64), NUMBER, array_of(np.float64, 2)))
def moved_centers(
    keys: Int,
    shape: tuple[int, int, int],
    corner_m: Float64,
    size_m: float,
    dst_SE3_grid: Float64,
) -> Float32:
    """Return the (K, 3) centres of cells after a motion; arguments as of `cells_of_moved`."""
    T, centers = dst_SE3_grid, np.empty((len(keys), 3), np.float32)
    for row in range(len(keys)):
        bar, k = divmod(keys[row], shape[2])
        i, j = divmod(bar, shape[1])
        x = corner_m[0] + (i + 0.5) * size_m
        y = corner_m[1] + (j + 0.5) * size_m
        z = corner_m[2] + (k + 0.5) * size_m
        for axis in range(3):
            centers[row, axis] = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z + T[axis, 3]
    return centers


@compiled((_KEYS, _KEYS, _POINTS, _KEYS, _KEYS, _RECTANGLE, WHOLE))
def remembered_voxels(
    keys: Int,
    ages: Int,
    centers: Float32,
    seen: Int,
    moving: Int,
    rectangle: tuple[float, float, float, float],
    max_age: int,
) -> tuple[Bool, Int]:
    """Return which of K voxels stay in a memory, and the rows of those of them that the newest scan has not observed.

    Args:
        keys: (K,) rising keys.
        ages: (K,) scans since each was observed.
        centers: (K, 3) their centres.
        seen: Rising keys of the voxels that the newest scan has observed.
        moving: Rising keys of those that move, where none stays.
        rectangle: Lowest and highest x, lowest and highest y, beyond which none stays.
        max_age: Age from which on a voxel that is not observed goes.
    """
    low_x, high_x, low_y, high_y = rectangle
    stays, unseen = np.empty(len(keys), np.bool_), np.empty(len(keys) + 1, np.int64)
    at_seen, at_moving, found = 0, 0, 0
    for row in range(len(keys)):
        key, x, y = keys[row], centers[row, 0], centers[row, 1]
        while at_seen < len(seen) and seen[at_seen] < key:
            at_seen += 1
        while at_moving < len(moving) and moving[at_moving] < key:
            at_moving += 1
        is_observed = at_seen < len(seen) and seen[at_seen] == key
        is_moving = at_moving < len(moving) and moving[at_moving] == key
        is_inside = (x > low_x) & (x < high_x) & (y > low_y) & (y < high_y)
        stays[row] = is_inside & (is_observed | (ages[row] < max_age)) & (not is_moving)
        unseen[found] = row
        found += int(stays[row] & (not is_observed))
    return stays, unseen[:found]


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
