"""Rigid transforms as (4, 4) float64 matrices, named `dst_SE3_src`: output frame on the left (2.1)-(2.6)."""

import numpy as np
from scipy.spatial.transform import Rotation

from perception.types import Float, Float32, Float64


def from_rotation_translation(rotation: Float, translation_m: Float) -> Float64:
    """Stack a (3, 3) rotation and a (3,) translation into one (4, 4) transform (2.5)."""
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = translation_m
    return transform


def from_euler(
    roll_rad: float, pitch_rad: float, yaw_rad: float, translation_m: Float | None = None
) -> Float64:
    """Build a transform from Rz(yaw) Ry(pitch) Rx(roll) (2.2)-(2.3) and a translation."""
    rotation = Rotation.from_euler("ZYX", [yaw_rad, pitch_rad, roll_rad]).as_matrix()
    return from_rotation_translation(
        rotation, np.zeros(3) if translation_m is None else translation_m
    )


def inverse(dst_SE3_src: Float64) -> Float64:
    """Return src_SE3_dst."""
    rotation = dst_SE3_src[:3, :3].T
    return from_rotation_translation(rotation, -rotation @ dst_SE3_src[:3, 3])


def transform_points(dst_SE3_src: Float64, points_src: Float32) -> Float32:
    """Move (N, 3+) points; columns after z, such as reflectance, are carried along."""
    moved = points_src.copy()
    rotation = dst_SE3_src[:3, :3].astype(points_src.dtype)
    np.matmul(points_src[:, :3], rotation.T, out=moved[:, :3])
    moved[:, :3] += dst_SE3_src[:3, 3].astype(points_src.dtype)
    return moved


def rotation_angle_rad(dst_SE3_src: Float64) -> float:
    """Return how far the transform turns, 0..pi."""
    cosine = (np.trace(dst_SE3_src[:3, :3]) - 1) / 2
    return float(np.arccos(np.clip(cosine, -1, 1)))
