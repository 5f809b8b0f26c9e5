"""Probability that there is an object, from the score of its box.

A score is the probability that a box overlaps its object by as much as KITTI requires: 0.7 for vehicles, 0.5 for people.
That an object is there is likelier, most of all in maps, in which vehicles end where the returns do:

    log-odds of existence = log-odds of score + offset
"""

import numpy as np
from numpy.typing import NDArray

from perception.types import Float64

# Chosen by tracks on eight synthetic drives, and on sequence 0000, where 0.4 to 0.6 make no difference.
_OFFSET = 0.5
_MAPS_OFFSET = 1.2  # of vehicles that no camera was searched for
_PEOPLE = ("Pedestrian", "Person_sitting", "Cyclist")
_EDGE = 1e-6  # minimum distance of scores from 0 and 1


def existence_of(scores: Float64, sets: NDArray[np.str_], types: NDArray[np.str_]) -> Float64:
    """Return the (M,) probabilities that there are objects.

    Args:
        scores: (M,) scores.
        sets: (M,) set of the modalities that were searched for the class of each, such as `dm+rm`.
        types: (M,) classes.
    """
    inside = np.clip(scores, _EDGE, 1 - _EDGE)
    has_camera = np.char.find(sets, "rgb") >= 0
    offsets = np.where(has_camera | np.isin(types, _PEOPLE), _OFFSET, _MAPS_OFFSET)
    return np.asarray(1 / (1 + np.exp(-offsets) * (1 - inside) / inside))
