"""Reference implementation of the short-term map of the thesis' 2.5D motion grids.

It gives what the fast map must give, line by line as thesis 5.2 describes it.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from perception.datmo.cell_grid import CellGrid
from perception.datmo.config import MotionGridConfig
from perception.datmo.elevation import ElevationGrid
from perception.geometry.se3 import inverse
from perception.types import Float32, Float64


@dataclass(frozen=True)
class _StoredGrid:
    elevation: ElevationGrid
    world_SE3_velo: Float64


class ReferenceShortTermMap:
    """The short-term map as in Algorithm 4: all stored grids are transformed at every scan."""

    def __init__(self, cells: CellGrid, config: MotionGridConfig) -> None:
        self._cells, self._config = cells, config
        self._queue: deque[_StoredGrid] = deque(maxlen=config.scans)

    @property
    def scans(self) -> int:
        """How many scans are in the queue."""
        return len(self._queue)

    def update(self, elevation: ElevationGrid, world_SE3_velo: Float64) -> Float32:
        """Take in a scan's grid and return the (X, Y) map around the vehicle."""
        self._queue.append(_StoredGrid(elevation, world_SE3_velo))
        total_m = np.zeros(self._cells.shape)
        count = np.zeros(self._cells.shape, np.int64)
        for stored in reversed(self._queue):
            seen_m = self._turned(stored, world_SE3_velo)
            counts = ~np.isnan(seen_m) & (count < self._config.max_observations)
            total_m[counts] += seen_m[counts]
            count[counts] += 1
        mean_m = total_m / np.maximum(count, 1)
        return np.where(count >= self._config.min_observations, mean_m, 0).astype(np.float32)

    def _turned(self, stored: _StoredGrid, world_SE3_velo: Float64) -> Float32:
        """Return a stored grid in today's cells, NaN where it saw nothing."""
        rows, columns = np.nonzero(stored.elevation.is_observed)
        centers_m = self._cells.centers_m(rows, columns)
        then = np.column_stack([centers_m, np.zeros(len(rows)), np.ones(len(rows))])
        now = then @ (inverse(world_SE3_velo) @ stored.world_SE3_velo).T
        into = np.floor((now[:, :2] - self._cells.low_m) / self._cells.cell_m).astype(int)
        inside = ((into >= 0) & (into < self._cells.shape)).all(axis=1)
        turned_m = np.full(self._cells.shape, np.nan, np.float32)
        turned_m[tuple(into[inside].T)] = stored.elevation.height_m[rows, columns][inside]
        return turned_m
