"""Upright 3D boxes: corners, edges, points inside, and transforms."""

import numpy as np

from perception.geometry.se3 import wrap
from perception.types import Bool, Boxes3D, Calibration, Float, Float64

# Corner signs along heading, left, up. Bottom face counter-clockwise from front left, then the top face.
CORNERS = np.array(
    [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0], [1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]]
) * (0.5, 0.5, 1.0)
# Pairs of corners: around the bottom, around the top, and upright.
EDGES = np.array(
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]]
)


def observation_angles_rad(boxes_velo: Boxes3D) -> Float64:
    """Return (M,) angles of boxes in the LiDAR frame; NaN where a box is.

    In the official labels the ray is that from the LiDAR, not from the camera (0.008 against 0.09 rad at most,
    measured).
    """
    x, y = boxes_velo.bottom_m[:, 0], boxes_velo.bottom_m[:, 1]
    return np.asarray(wrap(np.arctan2(y, x) - boxes_velo.yaw_rad - np.pi / 2))


def usual_observation_angles_rad(boxes_px: Float64, camera: Calibration) -> Float64:
    """Return (M,) angles of objects in the image of which only the box is known: headings are that of the camera.

    Most vehicles on a road have its direction, and KITTI's tool measures no orientation where a single one is unknown.
    """
    middles_px = (boxes_px[:, 0] + boxes_px[:, 2]) / 2
    rays_rad = np.arctan2(middles_px - camera.image_P_cam[0, 2], camera.image_P_cam[0, 0])
    return np.asarray(wrap(-np.pi / 2 - rays_rad))


def corners(boxes: Boxes3D) -> Float64:
    """Return (M, 8, 3) corners: the bottom face counter-clockwise from front left, then the top."""
    local = CORNERS[None] * boxes.size_m[:, None]
    cos, sin = np.cos(boxes.yaw_rad)[:, None], np.sin(boxes.yaw_rad)[:, None]
    x = cos * local[..., 0] - sin * local[..., 1]
    y = sin * local[..., 0] + cos * local[..., 1]
    return np.stack([x, y, local[..., 2]], axis=-1) + boxes.bottom_m[:, None]


def edges(boxes: Boxes3D) -> Float64:
    """Return (M, 12, 2, 3) both ends of each edge: around the bottom, around the top, upright."""
    return corners(boxes)[:, EDGES]


def points_inside(boxes: Boxes3D, points: Float, margin_m: float = 0.0) -> Bool:
    """Return (M, N): which points lie within which boxes, each grown by a margin on every side.

    The bottom is not lowered: points below a box are ground.
    """
    inside = np.zeros((len(boxes), len(points)), bool)
    for row, (bottom, size, yaw) in enumerate(
        zip(boxes.bottom_m, boxes.size_m, boxes.yaw_rad, strict=True)
    ):
        reach = np.hypot(size[0], size[1]) / 2 + 2 * margin_m
        near = np.flatnonzero(
            (np.abs(points[:, 0] - bottom[0]) < reach) & (np.abs(points[:, 1] - bottom[1]) < reach)
        )
        offset = points[near, :3] - bottom
        along = np.cos(yaw) * offset[:, 0] + np.sin(yaw) * offset[:, 1]
        across = np.cos(yaw) * offset[:, 1] - np.sin(yaw) * offset[:, 0]
        inside[row, near] = (
            (np.abs(along) <= size[0] / 2 + margin_m)
            & (np.abs(across) <= size[1] / 2 + margin_m)
            & (offset[:, 2] >= 0)
            & (offset[:, 2] <= size[2] + margin_m)
        )
    return inside


def transform_boxes(dst_SE3_src: Float64, boxes_src: Boxes3D) -> Boxes3D:
    """Move boxes by a transform that keeps them upright to within a few degrees."""
    turn_rad = np.arctan2(dst_SE3_src[1, 0], dst_SE3_src[0, 0])
    return Boxes3D(
        boxes_src.bottom_m @ dst_SE3_src[:3, :3].T + dst_SE3_src[:3, 3],
        boxes_src.size_m,
        boxes_src.yaw_rad + turn_rad,
    )
