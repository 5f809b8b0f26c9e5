"""Baselines that track a point of the object: 3D-KF and 3D-MS in scans alone (App. A.1), L-Fus with coloured points (7.1.2)."""

import numpy as np

from perception.errors import PerceptionError
from perception.geometry.camera import project
from perception.tracking.single_object.color_model import color_bins
from perception.tracking.single_object.config import ColorModelConfig, PointMeanShiftConfig
from perception.tracking.single_object.localizer import LocalizerInput, ObjectLocalizer
from perception.types import Bool, Float64, Int

_BINS = ColorModelConfig().bins


class GateLocalizer(ObjectLocalizer):
    """3D-KF: the object is the mean of all points in the gate."""

    def locate(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Return the mean of the points in the gate, or None of an empty gate."""
        return localizer_input.obstacles.centroid(localizer_input.gate)


class MeanShiftLocalizer(ObjectLocalizer):
    """3D-MS: the object is where points are densest near its last position."""

    def __init__(self, config: PointMeanShiftConfig) -> None:
        self._config = config

    def locate(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Shift the window from the predicted position."""
        return self.shift(localizer_input, self._config)


class ColoredPointsLocalizer(ObjectLocalizer):
    """L-Fus: the object is where points of its colours are densest.

    The colours are those of the points in the initial box, counted once (author's code). Points that the image does
    not show have no colour and no weight; where it shows none, or showed none initially, all weights are equal.
    """

    def __init__(self, config: PointMeanShiftConfig) -> None:
        self._config = config
        self._counts: Float64 = np.zeros(_BINS)

    def init(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Count the colours of the points in the initial box.

        Raises:
            PerceptionError: There is no image, or no camera.
        """
        tracker_input = localizer_input.tracker_input
        if tracker_input.image is None or tracker_input.image_P_velo is None:
            raise PerceptionError(
                "tracker l-fus",
                expected="an image of the first frame",
                found="none",
                advice="start where the camera sees the object, or choose a tracker in scans alone",
            )
        bins, is_observed = colors_of_points(localizer_input)
        inside = localizer_input.window.contains(localizer_input.obstacles.points_world)
        counts = np.bincount(bins[inside[is_observed]], minlength=_BINS)
        self._counts = counts.astype(np.float64)
        return super().init(localizer_input)

    def locate(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Shift the window from the predicted position; None beyond the gate."""
        found = self.shift(localizer_input, self._config, self._weights(localizer_input))
        if found is None or not localizer_input.gate.contains(found[None])[0]:
            return None
        return found

    def _weights(self, localizer_input: LocalizerInput) -> Float64 | None:
        bins, is_observed = colors_of_points(localizer_input)
        if not is_observed.any() or not self._counts.any():
            return None
        weights = np.zeros(len(is_observed))
        weights[is_observed] = self._counts[bins]
        return weights


def colors_of_points(localizer_input: LocalizerInput) -> tuple[Int, Bool]:
    """Return the colour bin of each point that the image shows, and (N,) which points these are."""
    points_velo = localizer_input.obstacles.points_velo
    image = localizer_input.tracker_input.image
    image_P_velo = localizer_input.tracker_input.image_P_velo
    if image is None or image_P_velo is None:
        return np.zeros(0, np.int64), np.zeros(len(points_velo), bool)
    pixels, _ = project(image_P_velo, points_velo)
    # Points behind the camera have no pixel; any position outside the image leaves them out.
    columns_rows = np.rint(np.nan_to_num(pixels, nan=-1.0)).astype(np.int64)
    is_observed = np.asarray(
        ((columns_rows >= 0) & (columns_rows < image.shape[1::-1])).all(axis=1)
    )
    columns, rows = columns_rows[is_observed].T
    return color_bins(image[rows, columns]), is_observed
