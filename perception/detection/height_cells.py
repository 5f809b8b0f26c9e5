"""The heights of a scan in square cells of the plane: where they vary, and how far over the lowest they are."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.types import Bool, Float, Float64, Int


@dataclass(frozen=True)
class HeightCells:
    """N heights, and the cell of a dense grid that each lies in.

    Attributes:
        z_m: (N,) above the LiDAR.
        cell_of: (N,) number of its cell, row by row.
        shape: of the grid.
        cell_m: edge of a cell.
    """

    z_m: Float64
    cell_of: Int
    shape: tuple[int, int]
    cell_m: float

    @classmethod
    def of(cls, points_velo: Float, cell_m: float) -> Self:
        """Sort (N, 3+) points into cells. The grid spans them all: points far away make it large."""
        if len(points_velo) == 0:
            return cls(np.zeros(0), np.zeros(0, np.int64), (1, 1), cell_m)
        x, y = (np.floor(points_velo[:, axis] / cell_m).astype(np.int64) for axis in (0, 1))
        x, y = x - x.min(), y - y.min()
        shape = int(x.max()) + 1, int(y.max()) + 1
        return cls(points_velo[:, 2].astype(np.float64), x * shape[1] + y, shape, cell_m)

    def has_variance(self, min_variance_m2: float) -> Bool:
        """Tell which points lie in a cell whose heights vary at least so much (6.1.2).

        The variance is that of a sample, over n - 1, as the author's code takes it; a single point has
        none.
        """
        count = self.shape[0] * self.shape[1]
        counts = np.bincount(self.cell_of, minlength=count)
        mean_m = np.bincount(self.cell_of, self.z_m, count) / np.maximum(counts, 1)
        squares = np.bincount(self.cell_of, (self.z_m - mean_m[self.cell_of]) ** 2, count)
        has_variance = squares / np.maximum(counts - 1, 1) >= min_variance_m2
        return np.asarray(has_variance[self.cell_of])

    def lowest_around_m(self, reach_m: float) -> Float64:
        """Return (N,) the least height around the cell of each point, so far on each side."""
        lowest = np.full(self.shape[0] * self.shape[1], np.inf)
        np.minimum.at(lowest, self.cell_of, self.z_m)
        side = 2 * round(reach_m / self.cell_m) + 1
        # Outside the grid lies what cv2.erode takes for infinitely high.
        around = cv2.erode(lowest.reshape(self.shape), np.ones((side, side), np.uint8))
        return np.asarray(around.ravel()[self.cell_of], np.float64)
