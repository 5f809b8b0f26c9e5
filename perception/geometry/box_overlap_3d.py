"""Overlap of upright boxes in space."""

import numpy as np

from perception.geometry.box_overlap_bev import paired_intersection_areas_m2
from perception.types import Boxes3D, Float64


def paired_iou_3d(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (M,) intersection over union of each box with the one in the same row of b (A.1).

    Both lie in one frame. 0 of no volume; NaN where a box is.
    """
    top_m = np.minimum(_tops_m(a), _tops_m(b))
    bottom_m = np.maximum(a.bottom_m[:, 2], b.bottom_m[:, 2])
    shared_m3 = paired_intersection_areas_m2(a, b) * np.maximum(top_m - bottom_m, 0.0)
    joint_m3 = a.size_m.prod(axis=1) + b.size_m.prod(axis=1) - shared_m3
    iou = np.divide(shared_m3, joint_m3, out=np.zeros_like(joint_m3), where=joint_m3 != 0)
    return np.asarray(iou)


def _tops_m(boxes: Boxes3D) -> Float64:
    return np.asarray(boxes.bottom_m[:, 2] + boxes.size_m[:, 2])
