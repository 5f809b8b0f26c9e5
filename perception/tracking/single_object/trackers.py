"""Factory of the trackers of one object, by name."""

from typing import get_args

from perception.errors import UsageError
from perception.sensor import LidarModel
from perception.tracking.single_object.baselines.histogram_finders import (
    BackProjectionFinder,
    CorrectedHistogramFinder,
)
from perception.tracking.single_object.baselines.image_trackers import (
    ImageOnlyTracker,
    missing_opencv_trackers,
    opencv_tracker,
)
from perception.tracking.single_object.baselines.point_baselines import (
    ColoredPointsLocalizer,
    GateLocalizer,
    MeanShiftLocalizer,
)
from perception.tracking.single_object.box.box_fit_tracker import BoxFitTracker
from perception.tracking.single_object.centroid_tracker import CentroidTracker
from perception.tracking.single_object.config import SingleObjectTrackerConfig, TrackerName
from perception.tracking.single_object.fusion.fusion_tracker import FusionTracker
from perception.tracking.single_object.tracker import SingleObjectTracker

# Best first; those that run on the installed OpenCV.
TRACKERS: tuple[str, ...] = tuple(
    name for name in get_args(TrackerName) if name not in missing_opencv_trackers()
)


def single_object_tracker(  # noqa: PLR0911  (one return for each tracker)
    name: str, sensor: LidarModel, config: SingleObjectTrackerConfig | None = None
) -> SingleObjectTracker:
    """Return a new tracker of one object.

    Args:
        name: One of `TRACKERS`.
        sensor: LiDAR model of the scans.
        config: Configuration of all trackers; None for the defaults.

    Raises:
        UsageError: There is no tracker of this name, or the installed OpenCV lacks it.
    """
    config = config or SingleObjectTrackerConfig()
    baselines = config.baselines
    match name:
        case "default":
            return BoxFitTracker(sensor, config.box)
        case "h-fus":
            return FusionTracker(sensor, config.fusion, config.point)
        case "l-fus":
            colored = ColoredPointsLocalizer(baselines.colored_points)
            return CentroidTracker(colored, sensor, config.point)
        case "3d-ms":
            shifted = MeanShiftLocalizer(baselines.mean_shift)
            return CentroidTracker(shifted, sensor, config.point, has_filter=False)
        case "3d-kf":
            return CentroidTracker(GateLocalizer(), sensor, config.point)
        case "ms-i":
            finder = BackProjectionFinder(baselines.histogram)
            return ImageOnlyTracker(name, finder, baselines.max_missed)
        case "cbwh":
            corrected = CorrectedHistogramFinder(baselines.histogram)
            return ImageOnlyTracker(name, corrected, baselines.max_missed)
        case "opencv-mil" | "opencv-kcf" | "opencv-csrt":
            return opencv_tracker(name, baselines.max_missed)
    raise UsageError(
        "tracker of one object", expected=f"one of {', '.join(get_args(TrackerName))}", found=name
    )
