"""Observation angle of KITTI: the heading ry of an object relative to the ray on which it is observed."""

import numpy as np

from perception.geometry.se3 import wrap
from perception.types import Boxes3D, Calibration, Float64


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
