"""Overlap and distance of upright boxes: in the bird's eye view, and in space."""

import numpy as np

from perception.kernels.shared_areas import paired_shared_areas, shared_areas
from perception.types import Boxes3D, Float64


def iou_bev(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (A, B) shared area over joint area of the boxes' outlines; 0 where a box has no area."""
    shared_m2 = intersection_areas_m2(a, b)
    joint_m2 = areas_m2(a)[:, None] + areas_m2(b)[None] - shared_m2
    return np.divide(shared_m2, joint_m2, out=np.zeros_like(shared_m2), where=joint_m2 > 0)


def intersection_areas_m2(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (A, B) the area that lies under both boxes; NaN where a box is."""
    return shared_areas(_outlines(a), _outlines(b))


def paired_intersection_areas_m2(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (M,) the area that lies under each box and the one in the same row of b; NaN where a box is."""
    return paired_shared_areas(_outlines(a), _outlines(b))


def paired_iou_bev(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (M,) shared area over joint area of each box and the one in the same row of b; 0 without an area."""
    shared_m2 = paired_intersection_areas_m2(a, b)
    joint_m2 = areas_m2(a) + areas_m2(b) - shared_m2
    return np.divide(shared_m2, joint_m2, out=np.zeros_like(shared_m2), where=joint_m2 > 0)


def center_distances_m(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (A, B) distances between the centres over the ground plane."""
    apart = a.bottom_m[:, None, :2] - b.bottom_m[None, :, :2]
    return np.asarray(np.hypot(apart[..., 0], apart[..., 1]))


def distance_similarity(distances_m: Float64, reach_m: float) -> Float64:
    """Turn distances into a likeness: 1 at no distance, falling evenly to 0 at the reach and beyond."""
    return np.asarray(np.maximum(0.0, 1.0 - distances_m / reach_m))


def areas_m2(boxes: Boxes3D) -> Float64:
    """Return (M,) areas of the outlines."""
    return np.asarray(boxes.size_m[:, 0] * boxes.size_m[:, 1])


def volumes_m3(boxes: Boxes3D) -> Float64:
    """Return (M,) volumes."""
    return np.asarray(boxes.size_m.prod(axis=1))


def _outlines(boxes: Boxes3D) -> Float64:
    return np.column_stack([boxes.bottom_m[:, :2], boxes.size_m[:, :2], boxes.yaw_rad])


def iou_3d(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (A, B) intersection over union of the volumes; 0 of no volume, NaN where a box is."""
    of_a, of_b = np.indices((len(a), len(b))).reshape(2, -1)
    return paired_iou_3d(a[of_a], b[of_b]).reshape(len(a), len(b))


def paired_iou_3d(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (M,) intersection over union of each box with the one in the same row of b (A.1).

    Both lie in one frame. 0 of no volume; NaN where a box is.
    """
    shared_m3 = paired_intersection_volumes_m3(a, b)
    joint_m3 = volumes_m3(a) + volumes_m3(b) - shared_m3
    iou = np.divide(shared_m3, joint_m3, out=np.zeros_like(joint_m3), where=joint_m3 != 0)
    return np.asarray(iou)


def paired_intersection_volumes_m3(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (M,) the volume that lies in each box and the one in the same row of b; NaN where a box is."""
    top_m = np.minimum(_tops_m(a), _tops_m(b))
    bottom_m = np.maximum(a.bottom_m[:, 2], b.bottom_m[:, 2])
    return np.asarray(paired_intersection_areas_m2(a, b) * np.maximum(top_m - bottom_m, 0.0))


def _tops_m(boxes: Boxes3D) -> Float64:
    return np.asarray(boxes.bottom_m[:, 2] + boxes.size_m[:, 2])
