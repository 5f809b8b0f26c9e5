"""L-Fus: fusion before tracking, by points that carry the colour at which they are seen (7.1.2)."""

import numpy as np

from perception.errors import PerceptionError
from perception.geometry.camera import project
from perception.sensor import LidarModel
from perception.tracking.single_object.centroid_tracker import (
    CentroidTracker,
    CentroidTrackerConfig,
    PointMotionConfig,
)
from perception.tracking.single_object.color_model import BINS, color_bins
from perception.tracking.single_object.lidar_baselines import mean_over
from perception.tracking.single_object.localizer import Localizer, View
from perception.tracking.single_object.mean_shift_3d import MeanShiftConfig, climb
from perception.types import Bool, Float64, Int


class ColoredPointsLocalizer(Localizer):
    """Climbs to where points of the object's colours are densest.

    The colours are those of the points in the first box, counted once (author's code). Points that the image
    does not show have no colour and no weight; where it shows none, or did not in the beginning, all weigh
    the same.
    """

    def __init__(self, config: MeanShiftConfig) -> None:
        self._config = config
        self._counts: Float64 = np.zeros(BINS)

    def begin(self, view: View) -> Float64 | None:
        """Count the colours of the points in the first box.

        Raises:
            PerceptionError: there is no image, or no camera.
        """
        if view.tracker_input.image is None or view.tracker_input.image_P_velo is None:
            raise PerceptionError(
                "tracker of coloured points",
                expected="an image of the first moment",
                found="none",
                advice="begin where the camera sees the object, or follow it by LiDAR alone",
            )
        bins, is_seen = colors_of_points(view)
        held = view.window.holds(view.around.points_world)
        self._counts = np.bincount(bins[held[is_seen]], minlength=BINS).astype(np.float64)
        return mean_over(view.window, view)

    def locate(self, view: View) -> Float64 | None:
        """Climb from the expected place; None beyond the gate."""
        climbed = climb(view.around.points_world, view.window, self._config, self._weights(view))
        if climbed is None or not view.gate.holds(climbed.place_m[None])[0]:
            return None
        return climbed.place_m

    def _weights(self, view: View) -> Float64 | None:
        bins, is_seen = colors_of_points(view)
        if not is_seen.any() or not self._counts.any():
            return None
        weights = np.zeros(len(is_seen))
        weights[is_seen] = self._counts[bins]
        return weights


def colors_of_points(view: View) -> tuple[Int, Bool]:
    """Return the bin of the colour of each point that the image shows, and (N,) which points these are."""
    count = len(view.around.points_velo)
    image, image_P_velo = view.tracker_input.image, view.tracker_input.image_P_velo
    if image is None or image_P_velo is None:
        return np.zeros(0, np.int64), np.zeros(count, bool)
    pixels, _ = project(image_P_velo, view.around.points_velo)
    # Of points behind the camera, which have no pixel, any place outside will do.
    places = np.rint(np.nan_to_num(pixels, nan=-1.0)).astype(np.int64)
    is_seen = np.asarray(((places >= 0) & (places < image.shape[1::-1])).all(axis=1))
    columns, rows = places[is_seen].T
    return color_bins(image[rows, columns]), is_seen


def colored_points_tracker(
    sensor: LidarModel, config: CentroidTrackerConfig | None = None
) -> CentroidTracker:
    """Make the tracker L-Fus."""
    return CentroidTracker(
        ColoredPointsLocalizer(MeanShiftConfig()), sensor, config, PointMotionConfig()
    )
