"""A window over the ground plane, and its mean shift to where points are densest (5.3.2)."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from perception.tracking.single_object.config import PointMeanShiftConfig
from perception.types import Bool, Float, Float64


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
