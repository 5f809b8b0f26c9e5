"""Localizers find the point that stands for an object, among the obstacle points near its predicted position."""

from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np

from perception.tracking.single_object.config import PointMeanShiftConfig
from perception.tracking.single_object.image_region import ImageRegion
from perception.tracking.single_object.tracker import TrackerInput
from perception.types import Bool, Float, Float32, Float64, GroundModel


@dataclass(frozen=True)
class Window:
    """Rectangle over the ground plane: a box in top view.

    Attributes:
        position_m: (3,) centre; the height is carried along.
        size_m: (2,) length along the heading, and width.
        yaw_rad: Heading.
    """

    position_m: Float64
    size_m: Float64
    yaw_rad: float

    def contains(self, points_m: Float) -> Bool:
        """Return (N,) whether each of (N, 2+) points lies in the window, at any height."""
        x, y = (points_m[:, :2] - self.position_m[:2]).T
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        half_length_m, half_width_m = self.size_m / 2
        return np.asarray(
            (np.abs(cos * x + sin * y) <= half_length_m)
            & (np.abs(cos * y - sin * x) <= half_width_m)
        )

    def moved(self, position_m: Float64) -> Self:
        """Return the window at another position."""
        return replace(self, position_m=position_m)

    def scaled(self, factor: float) -> Self:
        """Return the window with its size multiplied."""
        return replace(self, size_m=self.size_m * factor)


def mean_shift_3d(
    points_m: Float64, window: Window, config: PointMeanShiftConfig, weights: Float64 | None = None
) -> tuple[Window, ...]:
    """Shift a window to the mean of the points within, until it has converged.

    (5.11) and (5.12) with the sign that leads to the mean; as printed they lead away from it.

    Args:
        points_m: (N, 3) obstacle points.
        window: Window at the predicted position.
        config: Iterations and tolerance.
        weights: (N,) weight of each point; None for equal weights.

    Returns:
        The initial window and that after each shift; the initial one alone where it is empty.
    """
    mass = np.ones(len(points_m)) if weights is None else weights
    windows = [window]
    for _ in range(config.max_iterations):
        inside = windows[-1].contains(points_m)
        total = mass[inside].sum()
        if not total > 0:
            break
        mean_m = mass[inside] @ points_m[inside] / total
        shift_m = float(np.linalg.norm(mean_m - windows[-1].position_m))
        windows.append(window.moved(mean_m))
        if shift_m < config.tolerance_m:
            break
    return tuple(windows)


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
