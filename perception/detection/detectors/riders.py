"""Riders: public networks detect a person and a bicycle, where KITTI labels one cyclist around both.

    +--------+            +--------+
    | person |            |        |
    |  +-----+---+        |        |
    +--|bicycle  |  --->  |cyclist |
       +---------+        +--------+

A bicycle without a rider is no road user.
"""

from collections.abc import Mapping

import numpy as np

from perception.kernels.assignment import minimum_cost_pairs
from perception.types import Bool, Detections, Float64

# Of the narrower of both boxes: from behind, a bicycle is as wide as a wheel.
_MIN_SHARED_WIDTH = 0.5
# A rider's height in heights of the bicycle: half hidden behind it, or upright on a child's.
_MIN_HEIGHTS, _MAX_HEIGHTS = 0.7, 3.0
_BELOW = 0.15  # of a bicycle's height: a rider's feet end above its wheels, give or take this much


def join_riders(found: Detections, persons_of: Mapping[str, str]) -> Detections:
    """Return detections with one box around each rider and bicycle, best first.

    A cyclist is as sure as person and bicycle are on average (geometric mean); a pedestrian is a person without one.

    Args:
        found: Detections, of which a bicycle has the class that it becomes with a rider.
        persons_of: Class of persons by the class of riders.
    """
    for rider, person in persons_of.items():
        found = _joined(found, found.types == rider, found.types == person)
    return found


def _joined(found: Detections, is_bicycle: Bool, is_person: Bool) -> Detections:
    bicycles, persons = np.flatnonzero(is_bicycle), np.flatnonzero(is_person)
    bicycles_px, persons_px = found.boxes_px[bicycles, None], found.boxes_px[None, persons]
    worth = np.sqrt(found.scores[bicycles, None] * found.scores[None, persons])
    worth = np.where(_is_riding(persons_px, bicycles_px), worth, 0.0)
    rows, columns = minimum_cost_pairs(-worth)
    is_pair = worth[rows, columns] > 0
    ridden, riders = bicycles[rows[is_pair]], persons[columns[is_pair]]
    scores, boxes_px = found.scores.copy(), found.boxes_px.copy()
    boxes_px[ridden, :2] = np.minimum(boxes_px[ridden, :2], boxes_px[riders, :2])
    boxes_px[ridden, 2:] = np.maximum(boxes_px[ridden, 2:], boxes_px[riders, 2:])
    scores[riders] *= 1 - found.scores[ridden]
    scores[ridden] = worth[rows, columns][is_pair]
    is_kept = ~is_bicycle
    is_kept[ridden] = True
    order = np.argsort(-scores, kind="stable")
    return Detections(boxes_px, scores, found.types)[order[is_kept[order]]]


def _is_riding(persons_px: Float64, bicycles_px: Float64) -> Bool:
    """Return which of (..., 4) persons may sit on which of (..., 4) bicycles."""
    left, top, right, bottom = np.moveaxis(persons_px, -1, 0)
    wheels_left, bar, wheels_right, ground = np.moveaxis(bicycles_px, -1, 0)
    shared = np.minimum(right, wheels_right) - np.maximum(left, wheels_left)
    narrower = np.minimum(right - left, wheels_right - wheels_left)
    height, wheels = bottom - top, ground - bar
    return np.asarray(
        (shared >= _MIN_SHARED_WIDTH * narrower)
        & (top < bar)
        & (bottom > bar)
        & (bottom <= ground + _BELOW * wheels)
        & (height >= _MIN_HEIGHTS * wheels)
        & (height <= _MAX_HEIGHTS * wheels)
    )
