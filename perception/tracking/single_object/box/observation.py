"""What one scan shows where an object is expected."""

from dataclasses import dataclass, replace

import numpy as np

from perception.geometry.se3 import inverse
from perception.tracking.single_object.tracker import TrackerInput
from perception.types import Bool, Float64

_FULL_COUNT = 4  # points in a cell at which it weighs 1


@dataclass(frozen=True)
class ObjectObservation:
    """N small cells seen from above, each with its points' mean, in the world.

    Attributes:
        points_xy_m: (N, 2).
        tops_m: (N,) highest z.
        weights: (N,) more for cells with more points, 1 at most.
        sensor_xy_m: (2,).
    """

    points_xy_m: Float64
    tops_m: Float64
    weights: Float64
    sensor_xy_m: Float64

    def __len__(self) -> int:
        """Return N."""
        return len(self.weights)

    def distance_m(self, xy_m: Float64) -> float:
        """Return how far (2,) a place is from the sensor, at least 5 m: nearer, points get no denser."""
        return max(float(np.hypot(*(self.sensor_xy_m - xy_m))), 5.0)

    def near(self, xy_m: Float64, radius_m: float, max_cells: int) -> "ObjectObservation":
        """Return what lies near a place, thinned evenly to at most so many cells."""
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
        """Return the sight with only a share of the weight of some cells."""
        return replace(self, weights=np.where(rows, share * self.weights, self.weights))


def points_around(tracker_input: TrackerInput, position_world: Float64, reach_m: float) -> Float64:
    """Return the (N, 3) points in the world within a square around (3,) a place."""
    velo = inverse(tracker_input.world_SE3_velo)
    x, y, _ = velo[:3, :3] @ position_world + velo[:3, 3]
    # One column, then the other of what is left: a third of the time of both over all points.
    near = np.flatnonzero(np.abs(tracker_input.points_velo[:, 0] - np.float32(x)) < reach_m)
    near = near[np.abs(tracker_input.points_velo[near, 1] - np.float32(y)) < reach_m]
    world = tracker_input.world_SE3_velo
    return tracker_input.points_velo[near, :3].astype(np.float64) @ world[:3, :3].T + world[:3, 3]


def observation_of(points_world: Float64, sensor_xy_m: Float64, cell_m: float) -> ObjectObservation:
    """Gather (N, 3) points by cells of the ground plane."""
    if len(points_world) == 0:
        none = np.zeros(0)
        return ObjectObservation(np.zeros((0, 2)), none, none, sensor_xy_m)
    cells = np.floor(points_world[:, :2] / cell_m).astype(np.int64)
    cells -= cells.min(axis=0)
    keys = cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1]
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    points = points_world[order]
    counts = np.diff(starts, append=len(points))
    return ObjectObservation(
        np.add.reduceat(points[:, :2], starts) / counts[:, None],
        np.maximum.reduceat(points[:, 2], starts),
        np.sqrt(np.minimum(counts, _FULL_COUNT) / _FULL_COUNT),
        sensor_xy_m,
    )
