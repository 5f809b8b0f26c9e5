"""Heights of boxes on the ground: between the height of the class and that which the 2D box shows."""

import numpy as np

from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.image_heights import image_heights_m, top_deviations
from perception.types import Boxes3D, Calibration, Float64

_MAX_DEVIATIONS = 2.5  # from the height of the class that are trusted
_MIN_VEHICLE_DEVIATION_M = 0.3  # of the height of a vehicle, whose class may be another


def fit_heights(
    boxes: Boxes3D, boxes_px: Float64, sizes: SizePriors, calibration: Calibration
) -> Float64:
    """Return (F,) heights, weighted by the variances of the class and of the 2D box.

    Args:
        boxes: (F) boxes of any height.
        boxes_px: (F, 4) boxes in the image.
        sizes: (F) sizes of their classes.
        calibration: Calibration of the camera.
    """
    seen_m = image_heights_m(boxes, boxes_px, calibration.image_P_velo)
    mean_m, deviation_m = sizes.height_m.T
    # A vehicle may be of another class, a person is not.
    deviation_m = np.where(
        sizes.has_sides, np.maximum(deviation_m, _MIN_VEHICLE_DEVIATION_M), deviation_m
    )
    variance_m2 = (top_deviations(boxes_px) * mean_m) ** 2
    # The image's border cuts the upper side of what is near.
    trust = np.where(boxes_px[:, 1] <= 1, 0.0, deviation_m**2 / (deviation_m**2 + variance_m2))
    reach_m = _MAX_DEVIATIONS * deviation_m
    return np.asarray(mean_m + trust * np.clip(seen_m - mean_m, -reach_m, reach_m))
