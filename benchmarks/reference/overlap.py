"""Overlap of two rectangles x1 y1 x2 y2, for the reference implementations."""

from collections.abc import Sequence


def area(box: Sequence[float]) -> float:
    """Return the area of a box, 0 where it is empty."""
    return max(box[2] - box[0], 0.0) * max(box[3] - box[1], 0.0)


def shared_area(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the area of the intersection of two boxes."""
    return area([max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3])])


def iou(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the intersection over union of two boxes, 0 where they do not meet."""
    shared = shared_area(a, b)
    return shared / (area(a) + area(b) - shared) if shared else 0.0
