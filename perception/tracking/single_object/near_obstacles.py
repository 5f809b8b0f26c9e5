"""What stands around the place where an object is expected."""

from dataclasses import dataclass

import numpy as np

from perception.geometry import se3
from perception.tracking.single_object.tracker import TrackerInput
from perception.types import Float32, Float64, GroundModel


@dataclass(frozen=True)
class NearObstacles:
    """N points over the ground near an object.

    Attributes:
        points_velo: (N, 3) in the LiDAR frame of their scan.
        points_world: (N, 3) the same.
    """

    points_velo: Float32
    points_world: Float64


def obstacles_near(
    tracker_input: TrackerInput,
    ground: GroundModel,
    position_world: Float64,
    reach_m: float,
    heights_m: tuple[float, float],
) -> NearObstacles:
    """Return the points within a square around a place that lie between two heights over the ground."""
    position_velo = se3.inverse(tracker_input.world_SE3_velo) @ np.append(position_world, 1.0)
    # Column by column: two passes over a scan's x and y cost less than one over all its rows.
    near = np.flatnonzero(
        (np.abs(tracker_input.points_velo[:, 0] - np.float32(position_velo[0])) < reach_m)
        & (np.abs(tracker_input.points_velo[:, 1] - np.float32(position_velo[1])) < reach_m)
    )
    points_velo = tracker_input.points_velo[near, :3]
    above_m = ground.distance_m(points_velo)
    points_velo = points_velo[(above_m > heights_m[0]) & (above_m < heights_m[1])]
    rotation, origin_m = tracker_input.world_SE3_velo[:3, :3], tracker_input.world_SE3_velo[:3, 3]
    return NearObstacles(points_velo, points_velo.astype(np.float64) @ rotation.T + origin_m)
