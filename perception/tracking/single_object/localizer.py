"""Localizers find the point that stands for an object, among the obstacle points near its predicted position."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from perception.geometry import se3
from perception.tracking.single_object.tracker import TrackerInput
from perception.tracking.single_object.window import Window
from perception.types import Float32, Float64, GroundModel


@dataclass(frozen=True)
class NearObstacles:
    """N points above the ground near an object.

    Attributes:
        points_velo: (N, 3) points in the LiDAR frame of their scan.
        points_world: (N, 3) the same points in the world.
    """

    points_velo: Float32
    points_world: Float64


@dataclass(frozen=True)
class LocalizerInput:
    """Input of a localizer.

    Attributes:
        tracker_input: Scan, pose and image.
        obstacles: Obstacle points near the predicted object.
        window: Box at its predicted position, in the world.
        gate: Window that holds the object, in the world.
        elapsed_s: Time since the last input.
    """

    tracker_input: TrackerInput
    obstacles: NearObstacles
    window: Window
    gate: Window
    elapsed_s: float


class ObjectLocalizer(Protocol):
    """Finds the point that stands for an object."""

    def init(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Learn the object in its initial box; return its (3,) position in the world, None of an empty box.

        Raises:
            PerceptionError: The input lacks what the localizer requires.
        """
        ...

    def locate(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Return the (3,) position of the object in the world, or None where the gate does not hold it."""
        ...

    def reset(self, position_m: Float64) -> None:
        """Forget the motion of an object that is lost, and wait for it at (3,) a position in the world.

        A localizer without a motion filter does nothing.
        """
        del position_m


def obstacles_near(
    tracker_input: TrackerInput,
    ground: GroundModel,
    position_world: Float64,
    reach_m: float,
    heights_m: tuple[float, float],
) -> NearObstacles:
    """Return the points within a square around a position and between two heights above the ground."""
    position_velo = se3.inverse(tracker_input.world_SE3_velo) @ np.append(position_world, 1.0)
    # Column by column: two passes over a scan's x and y cost less than one over all its rows.
    near = np.flatnonzero(
        (np.abs(tracker_input.points_velo[:, 0] - np.float32(position_velo[0])) < reach_m)
        & (np.abs(tracker_input.points_velo[:, 1] - np.float32(position_velo[1])) < reach_m)
    )
    points_velo = tracker_input.points_velo[near, :3]
    above_m = ground.distance_m(points_velo)
    points_velo = points_velo[(above_m > heights_m[0]) & (above_m < heights_m[1])]
    world_SE3_velo = tracker_input.world_SE3_velo
    rotation, origin_m = world_SE3_velo[:3, :3], world_SE3_velo[:3, 3]
    return NearObstacles(points_velo, points_velo.astype(np.float64) @ rotation.T + origin_m)
