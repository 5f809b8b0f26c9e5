"""Exact DBSCAN in the plane, by square cells so small that all points of a cell are neighbours of each other.

The diagonal of a cell is the radius, so that all neighbours of a point lie within two cells. Points of a cell with enough
points are cores without any comparison, and two cells are joined as soon as two of their cores are close. Single points are
compared only where the bounding boxes of the points of two cells do not decide: rounded differences, squares and sums are
monotonic, so that what holds for the boxes holds exactly for their points.
"""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.kernels.graphs import root_of
from perception.kernels.sorting import sorted_by_digits
from perception.types import Bool, Float64, Int

_REACH = 2  # cells within which neighbours lie
_WHOLES, _POINTS, _MASK = array_of(WHOLE), array_of(NUMBER, 2), array_of(np.bool_)


@compiled((_WHOLES, WHOLE, _POINTS, _WHOLES, NUMBER))
def cell_pairs(
    keys: Int, stride: int, xy_m: Float64, starts: Int, limit: float
) -> tuple[Int, Int, Bool]:
    """Return the pairs of cells with points that may be neighbours, each pair once.

    Args:
        keys: (K,) rising keys of the cells: column times stride plus row.
        stride: Difference of the keys of two adjacent columns.
        xy_m: (N, 2) positions, sorted by cell.
        starts: (K + 1,) first point of each cell, and N.
        limit: Squared radius.

    Returns:
        (L,) cells with the smaller key, (L,) with the greater, and whether all points of one are neighbours of the other's.
    """
    count = len(keys)
    low_m, high_m = np.empty((count, 2)), np.empty((count, 2))
    for cell in range(count):
        low_m[cell], high_m[cell] = xy_m[starts[cell]], xy_m[starts[cell]]
        for point in range(starts[cell] + 1, starts[cell + 1]):
            for axis in range(2):
                low_m[cell, axis] = min(low_m[cell, axis], xy_m[point, axis])
                high_m[cell, axis] = max(high_m[cell, axis], xy_m[point, axis])
    size = count * (_REACH + _REACH * (2 * _REACH + 1))
    first, second = np.empty(size, np.int64), np.empty(size, np.int64)
    is_whole, found = np.empty(size, np.bool_), 0
    # In each column, the cells within reach come later for a later cell.
    nexts = np.zeros(_REACH + 1, np.int64)
    for cell in range(count):
        for right in range(_REACH + 1):
            lowest = keys[cell] + right * stride - _REACH if right else keys[cell] + 1
            while nexts[right] < count and keys[nexts[right]] < lowest:
                nexts[right] += 1
            other = nexts[right]
            while other < count and keys[other] <= keys[cell] + right * stride + _REACH:
                nearest, farthest = 0.0, 0.0
                for axis in range(2):
                    one = low_m[other, axis] - high_m[cell, axis]
                    another = low_m[cell, axis] - high_m[other, axis]
                    gap = max(one, another, 0.0)
                    span = min(one, another)
                    nearest, farthest = nearest + gap * gap, farthest + span * span
                if nearest <= limit:
                    first[found], second[found] = cell, other
                    is_whole[found] = farthest <= limit
                    found += 1
                other += 1
    return first[:found], second[:found], is_whole[:found]


@compiled((_POINTS, _WHOLES, _WHOLES, _WHOLES, _MASK, NUMBER, WHOLE))
def find_cores(
    xy_m: Float64,
    starts: Int,
    first: Int,
    second: Int,
    is_whole: Bool,
    limit: float,
    min_points: int,
) -> Bool:
    """Return the (N,) mask of the points with enough neighbours; arguments as of and by `cell_pairs`."""
    sure = starts[1:] - starts[:-1]
    for pair in range(len(first)):
        if is_whole[pair]:
            one, other = first[pair], second[pair]
            sure[one] += starts[other + 1] - starts[other]
            sure[other] += starts[one + 1] - starts[one]
    counts = np.empty(len(xy_m), np.int64)
    for cell in range(len(sure)):
        counts[starts[cell] : starts[cell + 1]] = sure[cell]
    for pair in range(len(first)):
        one, other = first[pair], second[pair]
        if is_whole[pair] or (sure[one] >= min_points and sure[other] >= min_points):
            continue
        for a in range(starts[one], starts[one + 1]):
            for b in range(starts[other], starts[other + 1]):
                x, y = xy_m[a, 0] - xy_m[b, 0], xy_m[a, 1] - xy_m[b, 1]
                if x * x + y * y <= limit:
                    counts[a] += 1
                    counts[b] += 1
    return counts >= min_points


@compiled((_POINTS, _WHOLES, _WHOLES, _WHOLES, _MASK, _MASK, NUMBER))
def joined_cells(
    xy_m: Float64,
    starts: Int,
    first: Int,
    second: Int,
    is_whole: Bool,
    is_core: Bool,
    limit: float,
) -> Int:
    """Return the (K,) representative of the cells whose cores belong together; -1 of a cell without cores.

    Arguments are as of and by `cell_pairs`, with the mask of the cores.
    """
    parents, has_cores = np.arange(len(starts) - 1), np.zeros(len(starts) - 1, np.bool_)
    for cell in range(len(parents)):
        has_cores[cell] = is_core[starts[cell] : starts[cell + 1]].any()
    for pair in range(len(first)):
        one, other = first[pair], second[pair]
        if not (has_cores[one] and has_cores[other]):
            continue
        root, other_root = root_of(parents, one), root_of(parents, other)
        if root == other_root:
            continue
        is_joined = is_whole[pair]
        for a in range(starts[one], starts[one + 1]):
            if is_joined:
                break
            if is_core[a]:
                for b in range(starts[other], starts[other + 1]):
                    x, y = xy_m[a, 0] - xy_m[b, 0], xy_m[a, 1] - xy_m[b, 1]
                    if x * x + y * y <= limit and is_core[b]:
                        is_joined = True
                        break
        if is_joined:
            parents[other_root] = root
    for cell in range(len(parents)):
        parents[cell] = root_of(parents, cell)
    for cell in range(len(parents)):
        if not has_cores[cell]:
            parents[cell] = -1
    return parents


@compiled((_POINTS, _WHOLES, WHOLE, WHOLE, _MASK, NUMBER, WHOLE, written(WHOLE)))
def reach_borders(
    xy_m: Float64,
    starts: Int,
    cell: int,
    other: int,
    is_core: Bool,
    limit: float,
    number: int,
    labels: Int,
) -> None:
    """Lower the labels of a cell's points that are no cores, but near one of another cell, to a number."""
    for point in range(starts[cell], starts[cell + 1]):
        if is_core[point] or labels[point] <= number:
            continue
        for core in range(starts[other], starts[other + 1]):
            x, y = xy_m[point, 0] - xy_m[core, 0], xy_m[point, 1] - xy_m[core, 1]
            if is_core[core] and x * x + y * y <= limit:
                labels[point] = number
                break


@compiled((_POINTS, NUMBER, NUMBER, WHOLE))
def dbscan(points_m: Float64, cells_per_m: float, radius_m: float, min_points: int) -> Int:
    """Return the (N,) cluster of each point, numbered in the order of their first cores, or -1 for noise.

    A border point of several clusters belongs to the first of them.

    Args:
        points_m: (N, 2) positions in metres.
        cells_per_m: Number of cells along a metre, slightly more than the diagonal allows.
        radius_m: Distance up to which two points are neighbours.
        min_points: Number of points within the radius, the point included, that make it a core.
    """
    count, limit = len(points_m), radius_m * radius_m
    low_x, low_y = points_m[:, 0].min(), points_m[:, 1].min()
    # Two spare rows, so that a step above the last row does not reach the next column.
    stride = int((points_m[:, 1].max() - low_y) * cells_per_m) + 1 + _REACH
    unsorted_keys = np.empty(count, np.int64)
    for point in range(count):
        column = np.int64((points_m[point, 0] - low_x) * cells_per_m)
        unsorted_keys[point] = column * stride + np.int64(
            (points_m[point, 1] - low_y) * cells_per_m
        )
    point_keys, order = sorted_by_digits(unsorted_keys)
    xy_m, cell_of, starts = np.empty((count, 2)), np.empty(count, np.int64), [0]
    for point in range(count):
        if point and point_keys[point] != point_keys[point - 1]:
            starts.append(point)
        xy_m[point], cell_of[order[point]] = points_m[order[point]], len(starts) - 1
    keys = point_keys[np.array(starts)]
    starts.append(count)
    bounds = np.array(starts)
    first, second, is_whole = cell_pairs(keys, stride, xy_m, bounds, limit)
    is_core = find_cores(xy_m, bounds, first, second, is_whole, limit, min_points)
    parts = joined_cells(xy_m, bounds, first, second, is_whole, is_core, limit)
    core_of = np.empty(count, np.bool_)
    core_of[order] = is_core
    # Numbers by first core; a cell without cores has the number of points, which no cluster has.
    number_of_part, found = np.full(len(keys), -1), 0
    for point in range(count):
        part = parts[cell_of[point]]
        if core_of[point] and number_of_part[part] < 0:
            number_of_part[part] = found
            found += 1
    numbers = np.array([number_of_part[part] if part >= 0 else count for part in parts])
    lowest = numbers.copy()
    for pair in range(len(first)):
        if is_whole[pair]:
            one, other = first[pair], second[pair]
            lowest[one] = min(lowest[one], numbers[other])
            lowest[other] = min(lowest[other], numbers[one])
    labels = np.empty(count, np.int64)
    for cell in range(len(keys)):
        for point in range(bounds[cell], bounds[cell + 1]):
            labels[point] = numbers[cell] if is_core[point] else lowest[cell]
    for pair in range(len(first)):
        if not is_whole[pair]:
            for one, other in ((first[pair], second[pair]), (second[pair], first[pair])):
                if numbers[other] < count:
                    reach_borders(xy_m, bounds, one, other, is_core, limit, numbers[other], labels)
    by_point = np.empty(count, np.int64)
    for point in range(count):
        by_point[order[point]] = labels[point] if labels[point] < count else -1
    return by_point
