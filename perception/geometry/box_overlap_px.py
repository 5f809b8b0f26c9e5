"""Overlap of upright boxes in the image, (M, 4) as x1 y1 x2 y2 with areas of (x2 - x1) (y2 - y1)."""

import numpy as np

from perception.kernels.boxes import iou_of_all
from perception.types import Float64


def iou_px(a: Float64, b: Float64) -> Float64:
    """Return (A, B) intersection over union of (A, 4) and (B, 4) boxes x1 y1 x2 y2; 0 of no area."""
    return iou_of_all(np.ascontiguousarray(a, np.float64), np.ascontiguousarray(b, np.float64))


def intersection_over_area_px(a: Float64, b: Float64) -> Float64:
    """Return (A, B) which share of each of (A, 4) boxes x1 y1 x2 y2 lies in each of (B, 4)."""
    return _share(intersection_px(a, b), area_px(a)[:, None])


def paired_iou_px(a: Float64, b: Float64) -> Float64:
    """Return (N,) intersection over union of each of (N, 4) boxes with the one in the same row of b."""
    intersection = paired_intersection_px(a, b)
    return _share(intersection, area_px(a) + area_px(b) - intersection)


def intersection_px(a: Float64, b: Float64) -> Float64:
    """Return (A, B) areas that (A, 4) and (B, 4) boxes x1 y1 x2 y2 have in common."""
    return paired_intersection_px(a[:, None], b[None])


def area_px(boxes_px: Float64) -> Float64:
    """Return (M,) areas of (M, 4) boxes x1 y1 x2 y2."""
    return np.asarray((boxes_px[:, 2:] - boxes_px[:, :2]).prod(axis=1))


def paired_intersection_px(a: Float64, b: Float64) -> Float64:
    """Return (...) areas that each of (..., 4) boxes has in common with the one in the same row of b."""
    width = np.minimum(a[..., 2], b[..., 2]) - np.maximum(a[..., 0], b[..., 0])
    height = np.minimum(a[..., 3], b[..., 3]) - np.maximum(a[..., 1], b[..., 1])
    return np.asarray(np.maximum(width, 0) * np.maximum(height, 0))


def _share(part: Float64, whole: Float64) -> Float64:
    return np.divide(part, whole, out=np.zeros(part.shape), where=whole > 0)
