"""Vertical columns over the ground plane: the one that holds each place, and counts of places by column or cluster."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled
from perception.types import Bool, Float32, Int, UInt8

_POINTS, _GROUPS, _MASK = array_of(np.float32, 2), array_of(np.int64), array_of(np.bool_)


@compiled((_POINTS, NUMBER))
def columns_of(places: Float32, cell_m: float) -> tuple[Int, Int]:
    """Return the (V,) column of each of (V, 3) places, and the (4,) first row, first column, rows and columns of all."""
    rows, columns = np.empty(len(places), np.int64), np.empty(len(places), np.int64)
    for k in range(len(places)):
        rows[k] = int(np.floor(places[k, 0] / cell_m))
        columns[k] = int(np.floor(places[k, 1] / cell_m))
    first_row, first_column = rows.min(), columns.min()
    width = columns.max() - first_column + 1
    extent = np.array([first_row, first_column, rows.max() - first_row + 1, width])
    for k in range(len(places)):
        rows[k] = (rows[k] - first_row) * width + columns[k] - first_column
    return rows, extent


@compiled((_GROUPS, _MASK, _GROUPS, NUMBER, NUMBER))
def joinable_columns(
    of: Int, persisted: Bool, extent: Int, weight: float, gap_rad: float
) -> tuple[Bool, UInt8]:
    """Return which columns have more places that did not persist than others, and these with the gaps between them.

    Gaps are columns without a place that persisted, within half of an angle of one of the former.

    Args:
        of: (V,) column of each place.
        persisted: (V,) whether it persisted.
        extent: (4,) first row, first column, rows and columns.
        weight: Weight of a place that persisted.
        gap_rad: Angle.

    Returns:
        (rows * columns,) mask and (rows, columns) image of 0 and 1.
    """
    first_row, first_column, height, width = extent
    counts = np.zeros((height * width, 2), np.int32)
    for k in range(len(of)):
        counts[of[k], int(persisted[k])] += 1
    chosen, joinable = np.empty(height * width, np.bool_), np.zeros((height, width), np.uint8)
    for column in range(height * width):
        chosen[column] = counts[column, 0] > counts[column, 1] * weight
        if not chosen[column]:
            continue
        row, line = divmod(column, width)
        x, y = first_row + row + 0.5, first_column + line + 0.5
        reach = int(np.sqrt(x * x + y * y) * gap_rad / 2)
        joinable[row, line] = 1
        for i in range(max(row - reach, 0), min(row + reach + 1, height)):
            for j in range(max(line - reach, 0), min(line + reach + 1, width)):
                joinable[i, j] |= counts[i * width + j, 1] == 0
    return chosen, joinable


@compiled((_GROUPS, _MASK, WHOLE))
def count_in_groups(groups: Int, chosen: Bool, size: int) -> Int:
    """Return how many of the chosen of V places each group has."""
    counts = np.zeros(size, np.int64)
    for k in range(len(groups)):
        counts[groups[k]] += chosen[k]
    return counts


@compiled((_POINTS, _POINTS, _GROUPS, NUMBER))
def groups_near(places: Float32, others: Float32, groups: Int, cell_m: float) -> tuple[Int, Int]:
    """Return (V,) the group, from 1, of one of (B, 3) others in the ground cell of each place, and in that or a neighbour.

    Both are 0 where there is none.
    """
    inside, near = np.zeros(len(places), np.int64), np.zeros(len(places), np.int64)
    if len(places) == 0 or len(others) == 0:
        return inside, near
    of_others, extent = columns_of(others, cell_m)
    first_row, first_column, height, width = extent
    held = np.zeros((2, height + 2, width + 2), np.int64)
    for k in range(len(others)):
        row, column = divmod(of_others[k], width)
        held[0, row + 1, column + 1] = groups[k]
        for i in range(row, row + 3):
            for j in range(column, column + 3):
                held[1, i, j] = groups[k]
    for k in range(len(places)):
        row = int(np.floor(places[k, 0] / cell_m)) - first_row + 1
        column = int(np.floor(places[k, 1] / cell_m)) - first_column + 1
        if row >= 0 and row < height + 2 and column >= 0 and column < width + 2:
            inside[k] = held[0, row, column]
            near[k] = inside[k] if inside[k] > 0 else held[1, row, column]
    return inside, near
