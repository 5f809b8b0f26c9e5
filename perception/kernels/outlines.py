"""Convex outlines of clusters of points over the ground plane."""

import numpy as np

from perception.kernels.compiled import WHOLE, array_of, compiled, written
from perception.types import Float64, Int

_PLACES, _ROWS = array_of(np.float64, 2), array_of(WHOLE)


@compiled((_PLACES, WHOLE, WHOLE, WHOLE))
def _turns_left(places_m: Float64, first: int, second: int, third: int) -> bool:
    """Return whether the way from the first place over the second to the third turns left."""
    x, y = places_m[first, 0], places_m[first, 1]
    along_x, along_y = places_m[second, 0] - x, places_m[second, 1] - y
    return bool(along_x * (places_m[third, 1] - y) > along_y * (places_m[third, 0] - x))


@compiled((_PLACES, WHOLE, written(WHOLE)))
def _sort_by_place(places_m: Float64, first: int, order: Int) -> None:
    """Write the rows of places from the first on by rising x and, where it is equal, y (Shell's sort)."""
    count, gap = len(order), 1
    for k in range(count):
        order[k] = first + k
    while 3 * gap < count:
        gap = 3 * gap + 1
    while gap:
        for k in range(gap, count):
            row, at = order[k], k
            x, y = places_m[row, 0], places_m[row, 1]
            while at >= gap:
                before = order[at - gap]
                x_before = places_m[before, 0]
                if x_before < x or (x_before == x and places_m[before, 1] <= y):
                    break
                order[at] = before
                at -= gap
            order[at] = row
        gap //= 3


@compiled((_PLACES, _ROWS))
def convex_outlines(places_m: Float64, starts: Int) -> tuple[Int, Int]:
    """Return the rows of the corners of the convex hull of each cluster, to the left around it, and how many each has.

    Args:
        places_m: (N, 2) places, one cluster after another.
        starts: (F + 1,) first row of each cluster, and N.
    """
    order, corners = np.empty(len(places_m), np.int64), np.empty(len(starts) - 1, np.int64)
    # On the way back the first corner is met again.
    hull, found = np.empty(2 * len(places_m) + 1, np.int64), 0
    for cluster in range(len(corners)):
        first, stop = starts[cluster], starts[cluster + 1]
        rows = order[first:stop]
        _sort_by_place(places_m, first, rows)
        begin, lowest = found, found + 1
        for k in range(2 * len(rows) - 1):
            # Along the right side to the last place, then back along the left side (Andrew).
            row = rows[k] if k < len(rows) else rows[2 * len(rows) - 2 - k]
            if k == len(rows):
                lowest = found
            while found > lowest and not _turns_left(
                places_m, hull[found - 2], hull[found - 1], row
            ):
                found -= 1
            last = hull[found - 1] if found > begin else -1
            if last < 0 or (places_m[last] != places_m[row]).any():
                hull[found] = row
                found += 1
        found -= int(found > begin + 1)
        corners[cluster] = found - begin
    return hull[:found], corners
