"""What the cells of a window over the earth have shown, at a cost that does not grow with memory.

The window follows the vehicle over an endless plane of cells. It is stored as a torus: the plane's
cell (i, j) always lies at (i mod size, j mod size), so that a moving window copies nothing and only
clears the cells that enter it.

    plane   ... 7 8 [ 9 10 11 12 ] 13 ...       a window of 4 cells that begins at 9
    torus           [ 12 9 10 11 ]              each at its number modulo 4; 13 would replace 9

Each cell keeps its last m observations in a ring and their sum. A new one adds itself and takes the
oldest away; a scan that leaves the queue of n takes away what is left of it. So the mean is always
at hand.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from perception.types import Float32, Int


@dataclass(frozen=True)
class _Observed:
    """The observations of one scan.

    Attributes:
        cells: (C,) flat numbers in the torus.
        order: (C,) how many observations the cell had before.
    """

    cells: Int
    order: Int


class CellHistory:
    """The mean of the last m observations of each cell, made within the last n scans."""

    def __init__(self, size: int, scans: int, averaged: int) -> None:
        """Begin with a window that has seen nothing.

        Args:
            size: cells along each side of the window.
            scans: n, after how many scans an observation is forgotten.
            averaged: m, how many observations of a cell count, the latest.
        """
        self.size = size
        self._averaged = min(averaged, scans)
        self._queue: deque[_Observed] = deque(maxlen=scans)
        self._low = np.zeros(2, np.int64)
        self._ring_m = np.zeros((self._averaged, size * size), np.float32)
        # Sums of float32 in float64 are exact, in whatever order they come and go.
        self._sum_m = np.zeros((size, size))
        # Observations are numbered cell by cell; those from `first` to before `next` count.
        self._first = np.zeros((size, size), np.int32)
        self._next = np.zeros((size, size), np.int32)

    def clear(self) -> None:
        """Forget everything."""
        self._queue.clear()
        self._forget(np.arange(self.size), 0)

    def move_to(self, low: Int) -> None:
        """Let the window begin at (2,) a plane cell; what it leaves is forgotten."""
        for axis in (0, 1):
            steps = int(low[axis] - self._low[axis])
            # Cells enter at the far end where the window moves up, at the near end otherwise.
            start = self._low[axis] + self.size if steps > 0 else low[axis]
            entering = start + np.arange(min(abs(steps), self.size))
            self._forget(entering % self.size, axis)
        self._low = np.array(low, np.int64)

    def observe(self, window_m: Float32) -> None:
        """Take in one scan's (size, size) values over the window, NaN where it saw nothing."""
        if len(self._queue) == self._queue.maxlen:
            self._expire(self._queue.popleft())
        torus_m = np.roll(window_m, self._low % self.size, axis=(0, 1)).ravel()
        cells = np.flatnonzero(~np.isnan(torus_m))
        values_m = torus_m.take(cells)
        first, following, sum_m = self._first.ravel(), self._next.ravel(), self._sum_m.ravel()
        order = following.take(cells)
        slot = order % self._averaged
        is_full = order - first.take(cells) == self._averaged
        sum_m[cells] += values_m.astype(np.float64) - self._ring_m[slot, cells] * is_full
        first[cells] += is_full
        following[cells] = order + 1
        self._ring_m[slot, cells] = values_m
        self._queue.append(_Observed(cells.astype(np.int32), order))

    def mean_m(self, least: int) -> Float32:
        """Return (size, size) means over the window, 0 where fewer observations than that count."""
        count = self._next - self._first
        mean_m = np.where(count >= least, self._sum_m / np.maximum(count, 1), 0).astype(np.float32)
        return np.roll(mean_m, -(self._low % self.size), axis=(0, 1))

    def _expire(self, scan: _Observed) -> None:
        first, sum_m = self._first.ravel(), self._sum_m.ravel()
        # Gone already is what later observations have replaced and what left the window.
        remains = first.take(scan.cells) == scan.order
        cells, order = scan.cells[remains], scan.order[remains]
        sum_m[cells] -= self._ring_m[order % self._averaged, cells]
        first[cells] += 1

    def _forget(self, lines: Int, axis: int) -> None:
        """Forget the rows (axis 0) or columns (axis 1) of the torus."""
        where = (lines, slice(None)) if axis == 0 else (slice(None), lines)
        self._first[where] = self._next[where]
        self._sum_m[where] = 0
