"""Ground estimation: the stage, by a smooth surface or by the thesis' piecewise planes."""

from typing import Protocol

import numpy as np

from perception.geometry.grids import LocalArea
from perception.localization.scan_window import ScanWindow, merge
from perception.obstacles.config import GroundConfig, PiecewisePlanesConfig
from perception.obstacles.ground_planes import PiecewisePlanesEstimator
from perception.obstacles.ground_surface import GroundSurfaceEstimator
from perception.sensor import LidarModel
from perception.types import GroundModel, Method


class GroundEstimator(Protocol):
    """Estimates the ground under the newest scan of a window."""

    def update(self, window: ScanWindow) -> GroundModel:
        """Return the ground in the newest scan's frame; a window of one scan starts a new drive."""
        ...


class WindowPlanesEstimator:
    """The thesis' planes through the merged scans of the window (Algorithm 3 on (5.1))."""

    def __init__(
        self, sensor: LidarModel, area: LocalArea, config: PiecewisePlanesConfig, seed: int
    ) -> None:
        self._planes = PiecewisePlanesEstimator(sensor, area, config)
        self._area, self._random = area, np.random.default_rng(seed)

    def update(self, window: ScanWindow) -> GroundModel:
        """Return the planes in the newest scan's frame."""
        return self._planes.estimate(merge(window, self._area).points_velo, self._random)


def ground_estimator(
    config: GroundConfig, method: Method, sensor: LidarModel, area: LocalArea, seed: int = 0
) -> GroundEstimator:
    """Make the ground estimator of a method.

    Args:
        config: Ground configuration.
        method: `default` for the smooth surface, `thesis` for piecewise planes.
        sensor: LiDAR model of the scans.
        area: Local area in which the ground is estimated.
        seed: Seed of RANSAC.
    """
    if method == "thesis":
        return WindowPlanesEstimator(sensor, area, config.planes, seed)
    return GroundSurfaceEstimator(sensor, area, config.surface)
