"""Square cells over the ground plane that hold points: their means, highest points and counts."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled
from perception.types import Bool, Float32, Float64, Int, UInt8

_POINTS, _CELL = array_of(np.float32, 2), array_of(np.int64)


@compiled((_POINTS, NUMBER))
def gather_cells(points: Float32, cell_m: float) -> tuple[UInt8, Int, Int, Float64, Int]:
    """Gather (N, 3+) points, at least one, by square cells counted from the origin.

    Returns:
        (X, Y) 1 where a cell has a point, with an empty cell on every side; (2,) cell of its corner; (C,) rows of the
        cells with points in it, flattened and rising; (C, 3) mean x and y of their points and the highest z; (C,) the
        numbers of points.
    """
    count, per_m = len(points), np.float32(1 / cell_m)
    cells = np.empty((count, 2), np.int64)
    low_x, low_y = np.int64(2**62), np.int64(2**62)
    high_x, high_y = np.int64(-(2**62)), np.int64(-(2**62))
    for row in range(count):
        x = np.int64(np.floor(points[row, 0] * per_m))
        y = np.int64(np.floor(points[row, 1] * per_m))
        cells[row, 0], cells[row, 1] = x, y
        low_x, high_x = min(low_x, x), max(high_x, x)
        low_y, high_y = min(low_y, y), max(high_y, y)
    low_x, low_y = low_x - 1, low_y - 1
    width = high_y - low_y + 2
    numbers = np.zeros((high_x - low_x + 2) * width, np.int32)
    sums, found = np.empty((count, 3)), 0
    counts = np.empty(count, np.int64)
    for row in range(count):
        at = (cells[row, 0] - low_x) * width + cells[row, 1] - low_y
        if numbers[at] == 0:
            sums[found, 0], sums[found, 1], sums[found, 2] = 0.0, 0.0, -np.inf
            counts[found] = 0
            found += 1
            numbers[at] = found
        number = numbers[at] - 1
        sums[number, 0] += points[row, 0]
        sums[number, 1] += points[row, 1]
        sums[number, 2] = max(sums[number, 2], np.float64(points[row, 2]))
        counts[number] += 1
    occupancy = np.zeros(len(numbers), np.uint8)
    rows, places_m, totals = (
        np.empty(found, np.int64),
        np.empty((found, 3)),
        np.empty(found, np.int64),
    )
    found = 0
    for at in range(len(numbers)):
        if numbers[at]:
            number = numbers[at] - 1
            occupancy[at], rows[found], totals[found] = 1, at, counts[number]
            places_m[found, 0] = sums[number, 0] / counts[number]
            places_m[found, 1] = sums[number, 1] / counts[number]
            places_m[found, 2] = sums[number, 2]
            found += 1
    first = np.array([low_x, low_y])
    return occupancy.reshape(-1, width), first, rows, places_m, totals


@compiled((_POINTS, array_of(np.uint8, 2), _CELL, NUMBER))
def are_beside_cells(points: Float32, occupancy: UInt8, first: Int, cell_m: float) -> Bool:
    """Return which of (P, 3+) points lie in an occupied cell or next to one.

    Args:
        points: (P, 3+) points.
        occupancy: (X, Y) 1 where a cell is occupied; none of the outermost is.
        first: (2,) cell of its corner, counted from the origin.
        cell_m: Edge of a cell in metres.
    """
    is_beside, per_m = np.zeros(len(points), np.bool_), np.float32(1 / cell_m)
    for row in range(len(points)):
        x = np.int64(np.floor(points[row, 0] * per_m)) - first[0]
        y = np.int64(np.floor(points[row, 1] * per_m)) - first[1]
        for i in range(max(x - 1, 0), min(x + 2, occupancy.shape[0])):
            for j in range(max(y - 1, 0), min(y + 2, occupancy.shape[1])):
                is_beside[row] |= occupancy[i, j] > 0
    return is_beside


@compiled((array_of(np.int32, 2), _CELL, _CELL))
def extents_of_parts(labels: Int, rows: Int, points: Int) -> tuple[Int, Int, Int]:
    """Return the (C,) part of each cell, the (K,) longer side of each part in cells, and its number of points.

    Args:
        labels: (X, Y) number of the part that each cell is in, 0 outside of all.
        rows: (C,) rows of the cells with points, in the flattened labels.
        points: (C,) numbers of points.
    """
    width, count = labels.shape[1], 0
    parts = np.empty(len(rows), np.int64)
    for k in range(len(rows)):
        parts[k] = labels[rows[k] // width, rows[k] % width]
        count = max(count, parts[k] + 1)
    low, high = np.full((count, 2), np.int64(2**62)), np.full((count, 2), np.int64(-1))
    totals = np.zeros(count, np.int64)
    for k in range(len(rows)):
        part, x, y = parts[k], rows[k] // width, rows[k] % width
        low[part, 0], high[part, 0] = min(low[part, 0], x), max(high[part, 0], x)
        low[part, 1], high[part, 1] = min(low[part, 1], y), max(high[part, 1], y)
        totals[part] += points[k]
    sides = np.zeros(count, np.int64)
    for part in range(count):
        for axis in range(2):
            sides[part] = max(sides[part], high[part, axis] - low[part, axis] + 1)
    return parts, sides, totals
