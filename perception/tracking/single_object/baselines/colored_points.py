"""L-Fus: fusion before tracking, by points that carry the colour at which they are seen (7.1.2)."""

import numpy as np

from perception.errors import PerceptionError
from perception.geometry.camera import project
from perception.sensor import LidarModel
from perception.tracking.single_object.baselines.lidar_baselines import mean_over
from perception.tracking.single_object.centroid_tracker import (
    CentroidTracker,
    CentroidTrackerConfig,
    PointMotionConfig,
)
from perception.tracking.single_object.color_model import BINS, color_bins
from perception.tracking.single_object.localizer import LocalizerInput, ObjectLocalizer
from perception.tracking.single_object.mean_shift_3d import MeanShiftConfig, mean_shift_3d
from perception.types import Bool, Float64, Int


class ColoredPointsLocalizer(ObjectLocalizer):
    """Climbs to where points of the object's colours are densest.

    The colours are those of the points in the first box, counted once (author's code). Points that the image
    does not show have no colour and no weight; where it shows none, or did not in the beginning, all weigh
    the same.
    """

    def __init__(self, config: MeanShiftConfig) -> None:
        self._config = config
        self._counts: Float64 = np.zeros(BINS)

    def init(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Count the colours of the points in the first box.

        Raises:
            PerceptionError: there is no image, or no camera.
        """
        if (
            localizer_input.tracker_input.image is None
            or localizer_input.tracker_input.image_P_velo is None
        ):
            raise PerceptionError(
                "tracker of coloured points",
                expected="an image of the first moment",
                found="none",
                advice="begin where the camera sees the object, or follow it by LiDAR alone",
            )
        bins, is_observed = colors_of_points(localizer_input)
        inside = localizer_input.window.contains(localizer_input.obstacles.points_world)
        self._counts = np.bincount(bins[inside[is_observed]], minlength=BINS).astype(np.float64)
        return mean_over(localizer_input.window, localizer_input)

    def locate(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Climb from the expected place; None beyond the gate."""
        shifted = mean_shift_3d(
            localizer_input.obstacles.points_world,
            localizer_input.window,
            self._config,
            self._weights(localizer_input),
        )
        if shifted is None or not localizer_input.gate.contains(shifted.position_m[None])[0]:
            return None
        return shifted.position_m

    def _weights(self, localizer_input: LocalizerInput) -> Float64 | None:
        bins, is_observed = colors_of_points(localizer_input)
        if not is_observed.any() or not self._counts.any():
            return None
        weights = np.zeros(len(is_observed))
        weights[is_observed] = self._counts[bins]
        return weights


def colors_of_points(localizer_input: LocalizerInput) -> tuple[Int, Bool]:
    """Return the bin of the colour of each point that the image shows, and (N,) which points these are."""
    count = len(localizer_input.obstacles.points_velo)
    image, image_P_velo = (
        localizer_input.tracker_input.image,
        localizer_input.tracker_input.image_P_velo,
    )
    if image is None or image_P_velo is None:
        return np.zeros(0, np.int64), np.zeros(count, bool)
    pixels, _ = project(image_P_velo, localizer_input.obstacles.points_velo)
    # Of points behind the camera, which have no pixel, any place outside will do.
    positions = np.rint(np.nan_to_num(pixels, nan=-1.0)).astype(np.int64)
    is_observed = np.asarray(((positions >= 0) & (positions < image.shape[1::-1])).all(axis=1))
    columns, rows = positions[is_observed].T
    return color_bins(image[rows, columns]), is_observed


def colored_points_tracker(
    sensor: LidarModel, config: CentroidTrackerConfig | None = None
) -> CentroidTracker:
    """Make the tracker L-Fus."""
    return CentroidTracker(
        ColoredPointsLocalizer(MeanShiftConfig()), sensor, config, PointMotionConfig()
    )
