"""Mean of the last observations of each cell of a moving window, at a cost independent of the memory.

The window follows the vehicle over an infinite plane of cells. It is stored as a torus: the plane's
cell (i, j) always lies at (i mod size, j mod size), so that a moving window copies nothing and only
clears the cells that enter it.

    plane   ... 7 8 [ 9 10 11 12 ] 13 ...       a window of 4 cells that begins at 9
    torus           [ 12 9 10 11 ]              each at its number modulo 4; 13 would replace 9

Each cell keeps its last m observations in a ring and their sum. A new observation replaces the
oldest; a scan that leaves the queue of n takes its remaining observations with it. So the mean is always available.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from perception.types import Float, Float32, Int


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

    def __init__(self, size: int, scans: int, max_observations: int, min_observations: int) -> None:
        """Start with an empty window.

        Args:
            size: Number of cells along each side of the window.
            scans: Number of scans after which an observation is forgotten (n).
            max_observations: Largest number of observations of a cell that are averaged, the latest (m).
            min_observations: Smallest number of observations of a cell that has a mean (k).
        """
        self.size = size
        self._max_observations = min(max_observations, scans)
        self._min_observations = min_observations
        self._queue: deque[_Observed] = deque(maxlen=scans)
        self._low = np.zeros(2, np.int64)
        # Observations are numbered cell by cell; those from `first` to before `next` count.
        self._first = np.zeros(size * size, np.int32)
        self._next = np.zeros(size * size, np.int32)
        self._ring_m = np.zeros(self._max_observations * size * size, np.float32)
        # Sums of float32 in float64 are exact, in any order.
        self._sum_m = np.zeros(size * size)
        self._mean_m = np.zeros(size * size, np.float32)

    @property
    def scans(self) -> int:
        """Number of remembered scans."""
        return len(self._queue)

    def clear(self) -> None:
        """Forget all observations."""
        self._queue.clear()
        self._forget(np.arange(self.size), 0)

    def move_to(self, low: Int) -> None:
        """Move the window to start at a (2,) cell of the plane; cells that leave it are forgotten."""
        for axis in (0, 1):
            steps = int(low[axis] - self._low[axis])
            # Cells enter at the far end where the window moves up, else at the near end.
            start = self._low[axis] + self.size if steps > 0 else low[axis]
            entering = start + np.arange(min(abs(steps), self.size))
            self._forget(entering % self.size, axis)
        self._low = np.array(low, np.int64)

    def observe(self, window_m: Float32) -> None:
        """Add one scan's (size, size) values over the window, NaN where a cell was not observed."""
        if len(self._queue) == self._queue.maxlen:
            self._expire(self._queue.popleft())
        torus_m = np.roll(window_m, self._low % self.size, axis=(0, 1)).ravel()
        cells = np.flatnonzero(~np.isnan(torus_m))
        values_m, order = torus_m.take(cells), self._next.take(cells)
        first = self._first.take(cells)
        slot = self._slot(cells, order)
        is_full = order - first == self._max_observations
        # A full ring gives up the value in whose place the new one goes.
        replaced_m = self._ring_m.take(slot) * is_full
        self._ring_m[slot] = values_m
        self._first[cells] = first + is_full
        self._next[cells] = order + 1
        self._add(cells, values_m.astype(np.float64) - replaced_m)
        self._queue.append(_Observed(cells.astype(np.int32), order))

    def mean_m(self) -> Float32:
        """Return (size, size) means over the window, 0 where fewer than k observations count."""
        mean_m = self._mean_m.reshape(self.size, self.size)
        return np.roll(mean_m, -(self._low % self.size), axis=(0, 1))

    def _expire(self, scan: _Observed) -> None:
        # Observations that were replaced or left the window are gone already.
        remains = np.flatnonzero(self._first.take(scan.cells) == scan.order)
        cells, order = scan.cells.take(remains), scan.order.take(remains)
        self._first[cells] += 1
        self._add(cells, -self._ring_m.take(self._slot(cells, order)))

    def _add(self, cells: Int, change_m: Float) -> None:
        """Change the sums of cells whose numbers of observations are up to date."""
        sum_m = self._sum_m.take(cells) + change_m
        self._sum_m[cells] = sum_m
        count = self._next.take(cells) - self._first.take(cells)
        self._mean_m[cells] = sum_m / np.maximum(count, 1) * (count >= self._min_observations)

    def _slot(self, cells: Int, order: Int) -> Int:
        """Return where in the rings the observations lie."""
        return np.asarray((order % self._max_observations).astype(np.int64) * self.size**2 + cells)

    def _forget(self, lines: Int, axis: int) -> None:
        """Forget the rows (axis 0) or columns (axis 1) of the torus."""
        where = (lines, slice(None)) if axis == 0 else (slice(None), lines)
        first, following, sum_m, mean_m = (
            torus.reshape(self.size, self.size)
            for torus in (self._first, self._next, self._sum_m, self._mean_m)
        )
        first[where] = following[where]
        sum_m[where] = mean_m[where] = 0
