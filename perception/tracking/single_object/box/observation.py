"""Observed points of one scan around the predicted object, averaged over small cells."""

from dataclasses import dataclass, replace

import numpy as np

from perception.types import Bool, Float64, Int

_FULL_COUNT = 4  # points in a cell of weight 1
_MIN_DISTANCE_M = 5.0  # nearer to the sensor, points get no denser


@dataclass(frozen=True)
class ObjectObservation:
    """N small cells in top view, each with the mean of its points, in the world.

    Attributes:
        points_xy_m: (N, 2) mean position of each cell's points.
        tops_m: (N,) highest z of each cell.
        weights: (N,) weight of each cell by its number of points, at most 1.
        sensor_xy_m: (2,) position of the sensor.
    """

    points_xy_m: Float64
    tops_m: Float64
    weights: Float64
    sensor_xy_m: Float64

    def __len__(self) -> int:
        """Return N."""
        return len(self.weights)

    def distance_m(self, xy_m: Float64) -> float:
        """Return the distance of (2,) a position from the sensor, at least 5 m."""
        return max(float(np.hypot(*(self.sensor_xy_m - xy_m))), _MIN_DISTANCE_M)

    def near(self, xy_m: Float64, radius_m: float, max_cells: int) -> "ObjectObservation":
        """Return the cells within a radius of (2,) a position, thinned out evenly to a maximum number."""
        off = self.points_xy_m - xy_m
        rows = np.flatnonzero((off**2).sum(axis=1) < radius_m**2)
        stride = max(1, -(-len(rows) // max_cells))
        rows = rows[::stride]
        return replace(
            self,
            points_xy_m=self.points_xy_m[rows],
            tops_m=self.tops_m[rows],
            weights=self.weights[rows] * stride,
        )

    def downweighted(self, rows: Bool, share: float) -> "ObjectObservation":
        """Return the observation with the weight of some cells reduced to a share."""
        return replace(self, weights=np.where(rows, share * self.weights, self.weights))


def observation_of(points_world: Float64, sensor_xy_m: Float64, cell_m: float) -> ObjectObservation:
    """Average (N, 3) points over cells of the ground plane."""
    if len(points_world) == 0:
        none = np.zeros(0)
        return ObjectObservation(np.zeros((0, 2)), none, none, sensor_xy_m)
    order, starts = cell_groups(points_world, cell_m)
    points = points_world[order]
    counts = np.diff(starts, append=len(points))
    return ObjectObservation(
        np.add.reduceat(points[:, :2], starts) / counts[:, None],
        np.maximum.reduceat(points[:, 2], starts),
        np.sqrt(np.minimum(counts, _FULL_COUNT) / _FULL_COUNT),
        sensor_xy_m,
    )


def cell_groups(points: Float64, cell_m: float) -> tuple[Int, Int]:
    """Return the order of (N, 2+) points, at least one, by their cells in top view, and the start of each cell in it."""
    cells = np.floor(points[:, :2] / cell_m).astype(np.int64)
    cells -= cells.min(axis=0)
    keys = cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1]
    order = np.argsort(keys, kind="stable")
    return order, np.flatnonzero(np.diff(keys[order], prepend=-1))
