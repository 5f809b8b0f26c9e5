"""Upright boxes x1 y1 x2 y2 in the image: overlaps, and which boxes suppress others."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled
from perception.types import Bool, Float64, Int

_BOXES, _CLASSES = array_of(NUMBER, 2), array_of(WHOLE)


@compiled((_BOXES, WHOLE, _BOXES, WHOLE))
def iou_of_rows(a: Float64, row: int, b: Float64, other: int) -> float:
    """Return the intersection over union of a box of (A, 4) and one of (B, 4); 0 of no area."""
    width = min(a[row, 2], b[other, 2]) - max(a[row, 0], b[other, 0])
    height = min(a[row, 3], b[other, 3]) - max(a[row, 1], b[other, 1])
    if not (width > 0 and height > 0):
        return 0.0
    shared = width * height
    first = (a[row, 2] - a[row, 0]) * (a[row, 3] - a[row, 1])
    second = (b[other, 2] - b[other, 0]) * (b[other, 3] - b[other, 1])
    return float(shared / (first + second - shared))


@compiled((_BOXES, _BOXES))
def iou_of_all(a: Float64, b: Float64) -> Float64:
    """Return (A, B) intersections over unions of (A, 4) and (B, 4) boxes."""
    overlaps = np.empty((len(a), len(b)))
    for row in range(len(a)):
        for other in range(len(b)):
            overlaps[row, other] = iou_of_rows(a, row, b, other)
    return overlaps


@compiled((_BOXES, _CLASSES, NUMBER))
def unsuppressed(boxes: Float64, classes: Int, max_iou: float) -> Bool:
    """Return the (M,) mask of boxes, best first, that no better one which stays overlaps by more.

    Args:
        boxes: (M, 4) boxes, best first.
        classes: (M,) numbers of classes; boxes of two classes do not suppress each other.
        max_iou: Overlap above which the worse of two boxes is suppressed.
    """
    is_kept = np.ones(len(boxes), np.bool_)
    for row in range(len(boxes)):
        if is_kept[row]:
            for other in range(row + 1, len(boxes)):
                if is_kept[other] and classes[other] == classes[row]:
                    is_kept[other] = iou_of_rows(boxes, row, boxes, other) <= max_iou
    return is_kept
