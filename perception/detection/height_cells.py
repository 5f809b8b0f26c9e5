"""Heights of a scan in square cells of the plane: their variance, and the lowest height around each point."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.types import Bool, Float, Float64, Int


@dataclass(frozen=True)
class HeightCells:
    """Heights of N points and their cells in a dense grid.

    Attributes:
        z_m: (N,) heights above the LiDAR in metres.
        cell_of: (N,) row-major index of the cell of each point.
        shape: Number of cells along x and y.
        cell_m: Edge of a cell in metres.
    """

    z_m: Float64
    cell_of: Int
    shape: tuple[int, int]
    cell_m: float

    @classmethod
    def of(cls, points_velo: Float, cell_m: float) -> Self:
        """Assign (N, 3+) points to cells of a grid that spans all of them."""
        if len(points_velo) == 0:
            return cls(np.zeros(0), np.zeros(0, np.int64), (1, 1), cell_m)
        x, y = (np.floor(points_velo[:, axis] / cell_m).astype(np.int64) for axis in (0, 1))
        x, y = x - x.min(), y - y.min()
        shape = int(x.max()) + 1, int(y.max()) + 1
        return cls(points_velo[:, 2].astype(np.float64), x * shape[1] + y, shape, cell_m)

    def has_variance(self, min_variance_m2: float) -> Bool:
        """Return the (N,) mask of the points in cells whose heights have at least a variance (6.1.2).

        It is the sample variance, over n - 1, as in the author's code; that of a single point is 0.
        """
        count = self.shape[0] * self.shape[1]
        counts = np.bincount(self.cell_of, minlength=count)
        mean_m = np.bincount(self.cell_of, self.z_m, count) / np.maximum(counts, 1)
        squares = np.bincount(self.cell_of, (self.z_m - mean_m[self.cell_of]) ** 2, count)
        has_variance = squares / np.maximum(counts - 1, 1) >= min_variance_m2
        return np.asarray(has_variance[self.cell_of])

    def lowest_around_m(self, reach_m: float) -> Float64:
        """Return the (N,) minimum heights around the cell of each point, up to a distance on each side."""
        lowest = self._lowest_m()
        return np.asarray(self._lowest_around(lowest, reach_m).ravel()[self.cell_of], np.float64)

    def ground_around_m(self, reach_m: float, step_m: float) -> Float64:
        """Return the (N,) mean heights of the ground around the cell of each point.

        The ground is the lowest point of each cell, where that is not far above the lowest of all: on a slope, and by
        the noise of many points, that one is below the ground.

        Args:
            reach_m: Distance on each side of the cell.
            step_m: Maximum height of ground above the lowest point around.
        """
        lowest = self._lowest_m()
        around = self._lowest_around(lowest, reach_m)
        is_ground = np.isfinite(lowest) & (lowest <= around + step_m)
        heights_m = np.where(is_ground, lowest, 0.0)
        side = (2 * round(reach_m / self.cell_m) + 1,) * 2
        sums, counts = (
            cv2.boxFilter(each, -1, side, normalize=False, borderType=cv2.BORDER_CONSTANT)
            for each in (heights_m, is_ground.astype(np.float64))
        )
        # The lowest cell around may be beside a lower one, with no ground between.
        heights_m = np.where(np.rint(counts) > 0, sums / np.maximum(counts, 1.0), around)
        return np.asarray(heights_m.ravel()[self.cell_of])

    def _lowest_m(self) -> Float64:
        """Return the minimum height in each cell, infinite where there are no points."""
        lowest = np.full(self.shape[0] * self.shape[1], np.inf)
        np.minimum.at(lowest, self.cell_of, self.z_m)
        return lowest.reshape(self.shape)

    def _lowest_around(self, lowest_m: Float64, reach_m: float) -> Float64:
        side = 2 * round(reach_m / self.cell_m) + 1
        # cv2.erode treats the outside of the grid as infinitely high.
        return np.asarray(cv2.erode(lowest_m, np.ones((side, side), np.uint8)), np.float64)
