"""Every tracker of one object, by the name under which commands know it."""

from collections.abc import Callable

from perception.errors import UsageError
from perception.sensor import LidarModel
from perception.tracking.single_object.baselines.colored_points import colored_points_tracker
from perception.tracking.single_object.baselines.histogram_finders import (
    BackProjectionFinder,
    CorrectedHistogramFinder,
)
from perception.tracking.single_object.baselines.image_only_tracker import ImageOnlyTracker
from perception.tracking.single_object.baselines.lidar_baselines import (
    kalman_tracker,
    mean_shift_tracker,
)
from perception.tracking.single_object.baselines.opencv_trackers import (
    missing_opencv_trackers,
    opencv_tracker,
)
from perception.tracking.single_object.box.box_fit_tracker import BoxFitTracker
from perception.tracking.single_object.fusion.fusion_tracker import FusionTracker
from perception.tracking.single_object.tracker import SingleObjectTracker

# Best first. A tracker is made anew for every object that is followed.
_FACTORIES: dict[str, Callable[[LidarModel], SingleObjectTracker]] = {
    "default": BoxFitTracker,
    "h-fus": FusionTracker,
    "l-fus": colored_points_tracker,
    "3d-ms": mean_shift_tracker,
    "3d-kf": kalman_tracker,
    "ms-i": lambda _: ImageOnlyTracker("ms-i", BackProjectionFinder()),
    "cbwh": lambda _: ImageOnlyTracker("cbwh", CorrectedHistogramFinder()),
    "opencv-mil": lambda _: opencv_tracker("opencv-mil"),
    "opencv-kcf": lambda _: opencv_tracker("opencv-kcf"),
    "opencv-csrt": lambda _: opencv_tracker("opencv-csrt"),
}

# Those that run on the OpenCV that is installed.
TRACKERS = tuple(name for name in _FACTORIES if name not in missing_opencv_trackers())


def single_object_tracker(name: str, sensor: LidarModel) -> SingleObjectTracker:
    """Make a tracker of one object.

    Args:
        name: one of `TRACKERS`.
        sensor: the LiDAR whose scans it will be shown.

    Raises:
        UsageError: there is no tracker of this name.
    """
    factory = _FACTORIES.get(name)
    if factory is None:
        raise UsageError(
            "tracker of one object", expected=f"one of {', '.join(_FACTORIES)}", found=name
        )
    return factory(sensor)
