"""Pairs of rows and columns at the minimum sum of costs."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled
from perception.types import Float64, Int


@compiled((array_of(NUMBER, 2),))
def _column_of_rows(costs: Float64) -> Int:
    """Return the (R,) column of each row of (R, C) costs, R at most C.

    One row after another gets a column by the shortest augmenting path, along which earlier rows change theirs
    (Jonker and Volgenant 1987).
    """
    rows, columns = costs.shape
    of_row, of_column = np.full(rows, -1), np.full(columns, -1)
    price_of_row, price_of_column = np.zeros(rows), np.zeros(columns)
    came_from = np.empty(columns, np.int64)
    for start in range(rows):
        lengths = np.full(columns, np.inf)
        is_reached = np.zeros(columns, np.bool_)
        row, length, end = start, 0.0, -1
        while end < 0:
            nearest = -1
            for column in range(columns):
                if is_reached[column]:
                    continue
                step = costs[row, column] - price_of_row[row] - price_of_column[column]
                if length + step < lengths[column]:
                    lengths[column], came_from[column] = length + step, row
                if nearest < 0 or lengths[column] < lengths[nearest]:
                    nearest = column
            is_reached[nearest] = True
            length = lengths[nearest]
            if of_column[nearest] < 0:
                end = nearest
            else:
                row = of_column[nearest]
        price_of_row[start] += length
        for column in range(columns):
            if is_reached[column]:
                if of_column[column] >= 0:
                    price_of_row[of_column[column]] += length - lengths[column]
                price_of_column[column] -= length - lengths[column]
        while True:
            row = came_from[end]
            of_column[end] = row
            of_row[row], end = end, of_row[row]
            if row == start:
                break
    return of_row


@compiled((array_of(NUMBER, 2),))
def minimum_cost_pairs(costs: Float64) -> tuple[Int, Int]:
    """Return the rows, rising, and the columns of as many pairs as (R, C) finite costs allow, at the minimum sum."""
    rows, columns = costs.shape
    if rows <= columns:
        return np.arange(rows), _column_of_rows(costs)
    row_of = _column_of_rows(np.ascontiguousarray(costs.T))
    order = np.argsort(row_of)
    return row_of[order], order
