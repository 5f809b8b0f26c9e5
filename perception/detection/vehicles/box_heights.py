"""Heights of boxes on the ground: between the height of the class and that which the 2D box shows."""

import numpy as np
from numpy.typing import NDArray

from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.evidence import likeliest_classes
from perception.tracking.vehicles.image_heights import image_heights_m, top_deviations
from perception.types import Boxes3D, Calibration, Detections, Float64, Int

# From low to high; what a detector of cars alone finds may be any of them.
_VEHICLES = ("Car", "Van", "Truck")
_HEIGHT_DEVIATION_M = 0.1  # of the height in one scan, which tells classes of vehicles apart
_SCORE_WEIGHT = 0.5  # of the logarithm of scores beside that of the likelihood of a height
_MAX_DEVIATIONS = 2.5  # from the height of the class that are trusted
_MIN_VEHICLE_DEVIATION_M = 0.3  # of the height of a vehicle, whose class may be another


def classes_by_height(detections: Detections, heights_m: Float64, leaders: Int) -> NDArray[np.str_]:
    """Return (M,) classes of detections; that of people and of what has no height stays.

    Args:
        detections: M detections.
        heights_m: (M,) heights of their boxes, NaN where unknown.
        leaders: (M,) row of the detection that stands for all at the place of each.
    """
    types, scores = detections.types, detections.scores
    classes = np.array(_VEHICLES)
    is_vehicle = np.isin(types, classes)
    best = np.lexsort((-scores, leaders))
    best = best[np.unique(leaders[best], return_index=True)[1]]  # one at each place
    best = best[is_vehicle[best] & np.isfinite(heights_m[best])]
    if not len(best):
        return types
    is_same_place = leaders[best][:, None] == leaders
    evidence = np.stack(
        [(is_same_place * scores * (types == one)).sum(axis=1) for one in classes], 1
    )
    numbers = likeliest_classes(
        evidence, heights_m[best], classes, _HEIGHT_DEVIATION_M, _SCORE_WEIGHT
    )
    # What hides the top of a vehicle makes it lower, nothing makes it higher.
    numbers = np.maximum(numbers, (types[best][:, None] == classes).argmax(axis=1))
    chosen = classes[numbers]
    found = types.astype(np.result_type(types, classes))
    taken = is_same_place & (types == chosen[:, None]) & (types[best] != chosen)[:, None]
    rows, others = np.nonzero(taken)
    found[others] = types[best[rows]]
    found[best] = chosen
    return found


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
