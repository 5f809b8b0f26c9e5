"""Cells of static points over the ground plane: a few thousand instead of tens of thousands of points."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from perception.geometry.footprints import Footprints, footprints_of
from perception.types import Bool, Float, Float64, Int, UInt8


@dataclass(frozen=True)
class StaticCells:
    """The C cells with static points.

    Attributes:
        occupancy: (X, Y) 1 where a cell has a static point.
        first: (2,) cell of the corner of `occupancy`, counted from the sensor.
        cell_m: Edge of a cell in metres.
        rows: (C,) indices of the cells in the flattened `occupancy`, rising.
        places_m: (C, 3) mean x and y of a cell's points, and their highest z.
        points: (C,) how many each holds.
    """

    occupancy: UInt8
    first: Int
    cell_m: float
    rows: Int
    places_m: Float64
    points: Int

    @classmethod
    def under(cls, points_velo: Float, cell_m: float) -> "StaticCells":
        """Gather (N, 3+) points, at least one."""
        x_m, y_m, z_m = np.ascontiguousarray(points_velo[:, :3].T)
        x, y = _cell_numbers(x_m, cell_m), _cell_numbers(y_m, cell_m)
        # A margin of one empty cell on every side.
        first = np.array([x.min() - 1, y.min() - 1], np.int64)
        shape = int(x.max() - first[0] + 2), int(y.max() - first[1] + 2)
        cell_of = (x - first[0]) * shape[1] + (y - first[1])
        counts = np.bincount(cell_of, minlength=shape[0] * shape[1])
        rows = np.flatnonzero(counts)
        highest_m = np.full(len(counts), -np.inf, z_m.dtype)
        np.maximum.at(highest_m, cell_of, z_m)
        sums = [np.bincount(cell_of, along_m)[rows] / counts[rows] for along_m in (x_m, y_m)]
        return cls(
            occupancy=(counts > 0).astype(np.uint8).reshape(shape),
            first=first,
            cell_m=cell_m,
            rows=rows,
            places_m=np.column_stack([*sums, highest_m[rows]]),
            points=counts[rows],
        )

    def clusters(self, min_points: int, length_m: float) -> Footprints:
        """Return the footprints of clusters up to a length; cells with a common corner are one cluster."""
        count, labels, stats, _ = cv2.connectedComponentsWithStats(self.occupancy, connectivity=8)
        cluster_of = np.asarray(labels.ravel()[self.rows], np.int64)
        longest = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
        points = np.bincount(cluster_of, self.points, count)
        kept = (longest * self.cell_m <= length_m) & (points >= min_points)
        kept[0] = False  # the space between
        number = np.cumsum(kept) - 1
        chosen = np.flatnonzero(kept[cluster_of])
        clusters = footprints_of(self.places_m[chosen], number[cluster_of[chosen]], int(kept.sum()))
        return replace(clusters, points=points[kept].astype(np.int64))

    def is_touching(self, points_velo: Float) -> Bool:
        """Return which of (P, 2+) points lie in a cell with a static point or next to one."""
        grown = cv2.dilate(self.occupancy, np.ones((3, 3), np.uint8))
        x = _cell_numbers(points_velo[:, 0], self.cell_m) - self.first[0]
        y = _cell_numbers(points_velo[:, 1], self.cell_m) - self.first[1]
        is_on = (x >= 0) & (y >= 0) & (x < grown.shape[0]) & (y < grown.shape[1])
        return np.asarray(is_on & (grown[np.where(is_on, x, 0), np.where(is_on, y, 0)] > 0))


def _cell_numbers(along_m: Float, cell_m: float) -> Int:
    return np.floor(along_m * (1 / cell_m)).astype(np.int64)
