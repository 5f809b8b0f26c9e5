"""Overlap of upright boxes in the image, (M, 4) as x1 y1 x2 y2 with areas of (x2 - x1) (y2 - y1)."""

import numpy as np

from perception.types import Float64


def iou_px(a: Float64, b: Float64) -> Float64:
    """Return (A, B) intersection over union of (A, 4) and (B, 4) boxes x1 y1 x2 y2; 0 of no area."""
    intersection = intersection_px(a, b)
    union = area_px(a)[:, None] + area_px(b) - intersection
    return _share(intersection, union)


def intersection_over_area_px(a: Float64, b: Float64) -> Float64:
    """Return (A, B) which share of each of (A, 4) boxes x1 y1 x2 y2 lies in each of (B, 4)."""
    return _share(intersection_px(a, b), area_px(a)[:, None])


def intersection_px(a: Float64, b: Float64) -> Float64:
    """Return (A, B) areas that (A, 4) and (B, 4) boxes x1 y1 x2 y2 have in common."""
    from_xy = np.maximum(a[:, None, :2], b[None, :, :2])
    to_xy = np.minimum(a[:, None, 2:], b[None, :, 2:])
    return np.asarray(np.clip(to_xy - from_xy, 0, None).prod(axis=2))


def area_px(boxes_px: Float64) -> Float64:
    """Return (M,) areas of (M, 4) boxes x1 y1 x2 y2."""
    return np.asarray((boxes_px[:, 2:] - boxes_px[:, :2]).prod(axis=1))


def _share(part: Float64, whole: Float64) -> Float64:
    return np.divide(part, whole, out=np.zeros(part.shape), where=whole > 0)
