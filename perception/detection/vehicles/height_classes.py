"""Classes of vehicles by their heights: the image of a van deceives a detector, its height above the ground does not.

The likeliest class of the height goes to the best detection at a place, if it is of a lower one. One of that class at the
same place, which was fainter, takes the other's class:

    Car 0.8  Van 0.2, 2.1 m high   becomes   Van 0.8  Car 0.2
"""

import numpy as np
from numpy.typing import NDArray

from perception.tracking.vehicles.evidence import likeliest_classes
from perception.types import Detections, Float64, Int

# From low to high; what a detector of cars alone finds may be any of them.
_VEHICLES = ("Car", "Van", "Truck")
_HEIGHT_DEVIATION_M = 0.1  # of the height in one scan, which tells classes of vehicles apart
_SCORE_WEIGHT = 0.5  # of the logarithm of scores beside that of the likelihood of a height


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
