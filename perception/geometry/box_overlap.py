"""Overlap and distance of upright boxes: in the bird's eye view, and in space."""

import numpy as np

from perception.types import Boxes3D, Float64

_FLAT_M = 1e-9  # an edge that rises less across the box is level


def iou_bev(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (A, B) shared area over joint area of the boxes' outlines; 0 where a box has no area."""
    shared_m2 = intersection_areas_m2(a, b)
    joint_m2 = areas_m2(a)[:, None] + areas_m2(b)[None] - shared_m2
    return np.divide(shared_m2, joint_m2, out=np.zeros_like(shared_m2), where=joint_m2 > 0)


def intersection_areas_m2(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (A, B) the area that lies under both boxes; NaN where a box is.

    Only pairs whose circumscribed circles meet are compared: of all pairs of a frame, few do.
    """
    rows, columns = np.nonzero(~(center_distances_m(a, b) > _radii_m(a)[:, None] + _radii_m(b)))
    shared_m2 = np.zeros((len(a), len(b)))
    shared_m2[rows, columns] = _shared_m2(a[rows], b[columns])
    return shared_m2


def paired_intersection_areas_m2(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (M,) the area that lies under each box and the one in the same row of b; NaN where a box is."""
    apart_m = np.linalg.norm(a.bottom_m[:, :2] - b.bottom_m[:, :2], axis=1)
    are_near = ~(apart_m > _radii_m(a) + _radii_m(b))
    shared_m2 = np.zeros(len(a))
    shared_m2[are_near] = _shared_m2(a[are_near], b[are_near])
    return shared_m2


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


def _radii_m(boxes: Boxes3D) -> Float64:
    return np.asarray(np.linalg.norm(boxes.size_m[:, :2], axis=1) / 2)


def _shared_m2(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (M,) the area that lies under each box and the one in the same row of b.

    In the frame of box b, seen along its width, box a is a heap of slices: what a slice shares with b
    is its upper end less its lower one, each clamped to b's sides. The edges of a are these ends, so
    the area is the sum, over the edges, of the integral of a clamped straight line; each has a closed
    form, and no polygon has to be cut.
    """
    corners = _corners_in(a, b)
    half_length, half_width = b.size_m[:, :1] / 2, b.size_m[:, 1:2] / 2
    (x0, y0), (x1, y1) = np.moveaxis(corners, -1, 0), np.moveaxis(np.roll(corners, -1, -2), -1, 0)
    across = x1 - x0
    slope = np.divide(y1 - y0, across, out=np.zeros_like(across), where=np.abs(across) > _FLAT_M)
    left, right = np.clip(x0, -half_length, half_length), np.clip(x1, -half_length, half_length)
    mean_m = _mean_clamped(y0 + (left - x0) * slope, y0 + (right - x0) * slope, half_width)
    # Corners run counter-clockwise: the upper ends are met from right to left.
    shared_m2 = ((left - right) * mean_m).sum(axis=-1)
    return np.asarray(np.maximum(shared_m2, 0.0))


def _corners_in(a: Boxes3D, b: Boxes3D) -> Float64:
    """Return (M, 4, 2) corners of each box a, counter-clockwise, along heading and left of box b."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2
    center = _turned(a.bottom_m[:, :2] - b.bottom_m[:, :2], -b.yaw_rad)
    reach = signs * a.size_m[:, None, :2]
    turn_rad = a.yaw_rad - b.yaw_rad
    return center[:, None] + _turned(reach, turn_rad[:, None])


def _turned(xy: Float64, angle_rad: Float64) -> Float64:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    x, y = xy[..., 0], xy[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def _mean_clamped(start: Float64, end: Float64, limit: Float64) -> Float64:
    """Return the mean of clamp(y, -limit, limit) for y from start to end."""
    rise = end - start
    is_level = np.abs(rise) <= _FLAT_M
    level = np.clip((start + end) / 2, -limit, limit)
    area = _clamped_integral(end, limit) - _clamped_integral(start, limit)
    return np.where(is_level, level, area / np.where(is_level, 1.0, rise))


def _clamped_integral(y: Float64, limit: Float64) -> Float64:
    """Return the integral of clamp(y, -limit, limit) from 0 to y."""
    inside = np.minimum(np.abs(y), limit)
    return np.asarray(inside**2 / 2 + limit * (np.abs(y) - inside))


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
