"""The trackers in scans alone that the fusion tracker is compared with (App. A.1)."""

import numpy as np

from perception.sensor import LidarModel
from perception.tracking.single_object.centroid_tracker import (
    CentroidTracker,
    CentroidTrackerConfig,
    PointMotionConfig,
)
from perception.tracking.single_object.localizer import LocalizerInput, ObjectLocalizer
from perception.tracking.single_object.mean_shift_3d import MeanShiftConfig, mean_shift_3d
from perception.tracking.single_object.window import Window
from perception.types import Float64


class GateLocalizer(ObjectLocalizer):
    """3D-KF: the object is the mean of all points in the gate."""

    def init(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Take the mean of the points in the first box."""
        return mean_over(localizer_input.window, localizer_input)

    def locate(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Return the mean, or None of an empty gate."""
        return mean_over(localizer_input.gate, localizer_input)


class MeanShiftLocalizer(ObjectLocalizer):
    """3D-MS: the object is where points are densest near its last place."""

    def __init__(self, config: MeanShiftConfig) -> None:
        self._config = config

    def init(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Take the mean of the points in the first box."""
        return mean_over(localizer_input.window, localizer_input)

    def locate(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Climb from the expected place."""
        shifted = mean_shift_3d(
            localizer_input.obstacles.points_world, localizer_input.window, self._config
        )
        return None if shifted is None else shifted.position_m


def mean_over(window: Window, localizer_input: LocalizerInput) -> Float64 | None:
    """Return (3,) the mean of the points over a window, or None where there are none."""
    points = localizer_input.obstacles.points_world[
        window.contains(localizer_input.obstacles.points_world)
    ]
    return np.asarray(points.mean(axis=0)) if len(points) else None


def kalman_tracker(
    sensor: LidarModel, config: CentroidTrackerConfig | None = None
) -> CentroidTracker:
    """Make the tracker 3D-KF: a filter with constant acceleration, and a gate."""
    return CentroidTracker(GateLocalizer(), sensor, config, PointMotionConfig())


def mean_shift_tracker(
    sensor: LidarModel, config: CentroidTrackerConfig | None = None, iterations: int = 3
) -> CentroidTracker:
    """Make the tracker 3D-MS: three shifts are its best (App. A.1), to 5 cm as in the author's code."""
    return CentroidTracker(MeanShiftLocalizer(MeanShiftConfig(iterations)), sensor, config)
