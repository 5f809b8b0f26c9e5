"""Points of the plane in square cells so small that all points of a cell are neighbours of each other.

The diagonal of a cell is the radius, so that all neighbours of a point lie within two cells.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.errors import UsageError
from perception.geometry.sorting import sorted_keys
from perception.types import ArrayTable, Bool, Float, Float64, Int

# Share by which a cell is smaller than its diagonal allows: more than rounding can move a point.
_SLACK = 1e-6
_MAX_CELLS = 2**30  # along an axis; with more, rounding would exceed the slack
_LARGEST_TABLE = 2**23


@dataclass(frozen=True)
class PointCells:
    """N points sorted by the K cells that are not empty.

    Attributes:
        order: (N,) index of the given point at each sorted position.
        x_m: (N,) sorted x in metres.
        y_m: (N,) sorted y in metres.
        starts: (K,) sorted position of the first point of each cell.
        counts: (K,) number of points of each cell.
        keys: (K,) ascending keys of the cells: column times stride plus row.
        stride: Difference of the keys of two adjacent columns.
        lows_m: (2, K) minimum x and y of the points of each cell.
        highs_m: (2, K) maximum x and y of the points of each cell.
    """

    order: Int
    x_m: Float64
    y_m: Float64
    starts: Int
    counts: Int
    keys: Int
    stride: int
    lows_m: tuple[Float64, Float64]
    highs_m: tuple[Float64, Float64]

    @classmethod
    def of(cls, xy_m: Float, radius_m: float) -> Self:
        """Sort (N, 2) points, at least one, into cells.

        Raises:
            UsageError: coordinates are not finite, or their extent is too large for the radius.
        """
        x_m, y_m = xy_m[:, 0].astype(np.float64), xy_m[:, 1].astype(np.float64)
        low_x, low_y = x_m.min(), y_m.min()
        per_m = np.sqrt(2) * (1 + _SLACK) / radius_m
        extent = (x_m.max() - low_x + y_m.max() - low_y) * per_m
        if not extent < _MAX_CELLS:
            raise UsageError(
                "points to cluster",
                expected=f"finite coordinates within {_MAX_CELLS} cells of the radius",
                found=f"an extent of {extent:.3g} cells",
            )
        # Two spare rows, so that a step above the last row does not reach the next column.
        row = ((y_m - low_y) * per_m).astype(np.int64)
        stride = int(row.max()) + 3
        point_keys, order = sorted_keys(((x_m - low_x) * per_m).astype(np.int64) * stride + row)
        x_m, y_m = x_m[order], y_m[order]
        starts = np.concatenate([[0], np.flatnonzero(point_keys[1:] != point_keys[:-1]) + 1])
        return cls(
            order=order,
            x_m=x_m,
            y_m=y_m,
            starts=starts,
            counts=np.concatenate([starts[1:], [len(order)]]) - starts,
            keys=point_keys[starts],
            stride=stride,
            lows_m=(np.minimum.reduceat(x_m, starts), np.minimum.reduceat(y_m, starts)),
            highs_m=(np.maximum.reduceat(x_m, starts), np.maximum.reduceat(y_m, starts)),
        )

    def __len__(self) -> int:
        """Return K."""
        return len(self.keys)

    def is_near(self, first: Int, second: Int, radius_m: float) -> Bool:
        """Return the (L,) mask of the pairs of points that are neighbours."""
        x, y = self.x_m[first] - self.x_m[second], self.y_m[first] - self.y_m[second]
        return np.asarray(x * x + y * y <= radius_m * radius_m)

    def may_be_near(self, points: Int, cells: Int, radius_m: float) -> Bool:
        """Return the (L,) mask of the points within the radius of the bounding box of a cell's points."""
        x = _gap(self.x_m[points], self.lows_m[0][cells], self.highs_m[0][cells])
        y = _gap(self.y_m[points], self.lows_m[1][cells], self.highs_m[1][cells])
        return np.asarray(x * x + y * y <= radius_m * radius_m)


@dataclass(frozen=True)
class CellPairs(ArrayTable):
    """L pairs of cells with points that may be neighbours, each pair once.

    Attributes:
        first: (L,) cell with the smaller key, ascending.
        second: (L,) cell with the greater key.
        is_whole: (L,) mask of the pairs in which all points of one cell are neighbours of all of the other.
    """

    first: Int
    second: Int
    is_whole: Bool

    @classmethod
    def of(cls, cells: PointCells, radius_m: float) -> Self:
        """Find the pairs by the bounding boxes of the points of each cell.

        Rounded differences, squares and sums are monotonic, so that what holds for the box holds exactly for its
        points.
        """
        steps = [1, 2, *(cells.stride * right + up for right in (1, 2) for up in range(-2, 3))]
        second = _find(cells.keys, (cells.keys[:, None] + steps).ravel())
        exists = np.flatnonzero(second >= 0)
        first, second = exists // len(steps), second[exists]
        limit, nearest, farthest = radius_m * radius_m, np.zeros(len(first)), np.zeros(len(first))
        for low_m, high_m in zip(cells.lows_m, cells.highs_m, strict=True):
            one, other = low_m[second] - high_m[first], low_m[first] - high_m[second]
            gap = np.maximum(np.maximum(one, other), 0)
            span = np.minimum(one, other)
            nearest, farthest = nearest + gap * gap, farthest + span * span
        near = np.flatnonzero(nearest <= limit)
        return cls(first[near], second[near], farthest[near] <= limit)


def expand_ranges(starts: Int, counts: Int) -> tuple[Int, Int]:
    """Return the range and the number of each element of several integer ranges, end to end.

    Args:
        starts: (R,) first number of each range.
        counts: (R,) length of each range.
    """
    owner = np.arange(len(counts)).repeat(counts)
    before = counts.cumsum() - counts
    return owner, np.arange(len(owner)) + (starts - before)[owner]


def _find(keys: Int, queries: Int) -> Int:
    """Return the position of each query among the ascending keys, or -1."""
    table_size = int(queries.max()) + 1
    if table_size > _LARGEST_TABLE:
        at = np.minimum(np.searchsorted(keys, queries), len(keys) - 1)
        return np.where(keys[at] == queries, at, -1)
    table = np.full(table_size, -1)
    table[keys] = np.arange(len(keys))
    # No query is negative: the steps do not reach below the smallest key.
    return table[queries]


def _gap(values: Float64, lows: Float64, highs: Float64) -> Float64:
    return np.asarray(np.maximum(np.maximum(lows - values, values - highs), 0))
