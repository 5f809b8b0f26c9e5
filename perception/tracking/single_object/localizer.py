"""Localizers find the point that stands for an object, among the obstacle points near its predicted position."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from perception.tracking.single_object.config import PointMeanShiftConfig
from perception.tracking.single_object.image_region import ImageRegion
from perception.tracking.single_object.tracker import TrackerInput
from perception.tracking.single_object.window import Window, mean_shift_3d
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

    def centroid(self, window: Window) -> Float64 | None:
        """Return (3,) the mean of the points over a window, in the world; None without a point.

        It is the point model of the object (5.3.2), which needs few points.
        """
        inside = self.points_world[window.contains(self.points_world)]
        return np.asarray(inside.mean(axis=0)) if len(inside) else None


@dataclass(frozen=True)
class LocalizerInput:
    """Input of a localizer.

    Attributes:
        tracker_input: Scan, pose and image.
        ground: Ground of the scan, below which no point is an obstacle.
        obstacles: Obstacle points near the predicted object.
        window: Box at its predicted position, in the world.
        gate: Window that holds the object, in the world.
        elapsed_s: Time since the last input.
    """

    tracker_input: TrackerInput
    ground: GroundModel
    obstacles: NearObstacles
    window: Window
    gate: Window
    elapsed_s: float


class ObjectLocalizer(Protocol):
    """Finds the point that stands for an object.

    Attributes:
        windows: Windows of the last mean shift in the scan, from the predicted to the converged one; none of a
            localizer without a mean shift.
        region: Region of the object in the last image, or None of a localizer in scans alone, and where the
            image does not show the object.
    """

    windows: tuple[Window, ...] = ()
    region: ImageRegion | None = None

    def init(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Learn the object in its initial box; return its (3,) position in the world, None of an empty box.

        A localizer that learns nothing takes the mean of the points in the box.

        Raises:
            PerceptionError: The input lacks what the localizer requires.
        """
        return localizer_input.obstacles.centroid(localizer_input.window)

    def locate(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Return the (3,) position of the object in the world, or None where the gate does not hold it."""
        ...

    def reset(self, position_m: Float64) -> None:
        """Forget the motion of an object that is lost, and wait for it at (3,) a position in the world.

        A localizer without a motion filter does nothing.
        """
        del position_m

    def shift(
        self,
        localizer_input: LocalizerInput,
        config: PointMeanShiftConfig,
        weights: Float64 | None = None,
    ) -> Float64 | None:
        """Return (3,) where a mean shift from the predicted position converges; None of an empty window."""
        points_world, window = localizer_input.obstacles.points_world, localizer_input.window
        self.windows = mean_shift_3d(points_world, window, config, weights)
        return self.windows[-1].position_m if len(self.windows) > 1 else None


def obstacles_near(
    tracker_input: TrackerInput,
    ground: GroundModel,
    position_world: Float64,
    reach_m: float,
    heights_m: tuple[float, float],
) -> NearObstacles:
    """Return the points within a square around a position and between two heights above the ground."""
    points_velo = tracker_input.points_near(position_world, reach_m)
    above_m = ground.distance_m(points_velo)
    points_velo = points_velo[(above_m > heights_m[0]) & (above_m < heights_m[1])]
    return NearObstacles(points_velo, tracker_input.in_world(points_velo))
