"""Rigid transforms as (4, 4) float64 matrices, named `dst_SE3_src`: output frame on the left (2.1)-(2.6)."""

import math

import cv2
import numpy as np

from perception.types import Bool, Float, Float32, Float64

_IDENTITY = np.eye(4)  # a copy takes an eighth of the time of np.eye


def from_rotation_translation(rotation: Float, translation_m: Float) -> Float64:
    """Stack a (3, 3) rotation and a (3,) translation into one (4, 4) transform (2.5)."""
    transform = _IDENTITY.copy()
    transform[:3, :3] = rotation
    transform[:3, 3] = translation_m
    return transform


def from_euler(
    roll_rad: float, pitch_rad: float, yaw_rad: float, translation_m: Float | None = None
) -> Float64:
    """Build a transform from Rz(yaw) Ry(pitch) Rx(roll) (2.2)-(2.3) and a translation."""
    cos_r, cos_p, cos_y = np.cos([roll_rad, pitch_rad, yaw_rad])
    sin_r, sin_p, sin_y = np.sin([roll_rad, pitch_rad, yaw_rad])
    rotation = (
        np.array([[cos_y, -sin_y, 0.0], [sin_y, cos_y, 0.0], [0.0, 0.0, 1.0]])
        @ np.array([[cos_p, 0.0, sin_p], [0.0, 1.0, 0.0], [-sin_p, 0.0, cos_p]])
        @ np.array([[1.0, 0.0, 0.0], [0.0, cos_r, -sin_r], [0.0, sin_r, cos_r]])
    )
    return from_rotation_translation(
        rotation, np.zeros(3) if translation_m is None else translation_m
    )


def rotation_vector(rotation: Float) -> Float64:
    """Return the (3,) axis times the angle in radians of a (3, 3) rotation by less than half a turn."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.asarray(rotation, np.float64).tolist()
    twice_sines = (zy - yz, xz - zx, yx - xy)
    sine = math.hypot(*twice_sines) / 2
    angle_rad = math.atan2(sine, (xx + yy + zz - 1) / 2)
    return np.array(twice_sines) * (angle_rad / sine / 2 if sine > 0 else 0.5)


def from_rotation_vector(vector: Float) -> Float64:
    """Return the (3, 3) rotation about a (3,) axis by its length in radians (Rodrigues' formula)."""
    # Scalars of Python: NumPy takes ten times as long for one number.
    x, y, z = np.asarray(vector, np.float64).tolist()
    angle_rad = math.hypot(x, y, z)
    if angle_rad == 0:
        return np.eye(3)
    # I + a [v] + b [v]^2
    a, half_chord = math.sin(angle_rad) / angle_rad, 2 * math.sin(angle_rad / 2) / angle_rad
    b = half_chord**2 / 2
    return np.array(
        [
            [1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)],
        ]
    )


def motion_vector(dst_SE3_src: Float64) -> Float64:
    """Return the (6,) rotation vector in rad and translation in metres of a transform."""
    return np.concatenate([rotation_vector(dst_SE3_src[:3, :3]), dst_SE3_src[:3, 3]])


def from_motion_vector(motion: Float) -> Float64:
    """Return the transform of a (6,) rotation vector and translation."""
    return from_rotation_translation(from_rotation_vector(motion[:3]), motion[3:])


def cross_matrix(vector: Float) -> Float64:
    """Return the (3, 3) matrix that multiplies as the cross product with a vector does."""
    x, y, z = np.asarray(vector, np.float64).tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def inverse(dst_SE3_src: Float64) -> Float64:
    """Return src_SE3_dst."""
    rotation = dst_SE3_src[:3, :3].T
    return from_rotation_translation(rotation, -rotation @ dst_SE3_src[:3, 3])


def transform_points(dst_SE3_src: Float64, points_src: Float32) -> Float32:
    """Move (N, 3+) points; columns after z, such as reflectance, are carried along."""
    if len(points_src) == 0:
        return points_src.copy()
    columns = points_src.shape[1]
    matrix = np.eye(columns, columns + 1)
    matrix[:3, :3] = dst_SE3_src[:3, :3]
    matrix[:3, columns] = dst_SE3_src[:3, 3]
    # Ten times as fast as a product of the first three columns.
    return np.asarray(cv2.transform(np.ascontiguousarray(points_src)[None], matrix)[0])


def interpolate(before: Float64, after: Float64, share: float) -> Float64:
    """Return the transform at a share of the way between two: straight, and turning evenly (slerp)."""
    turn = rotation_vector(before[:3, :3].T @ after[:3, :3])
    return from_rotation_translation(
        before[:3, :3] @ from_rotation_vector(share * turn),
        (1 - share) * before[:3, 3] + share * after[:3, 3],
    )


def rotation_angle_rad(dst_SE3_src: Float64) -> float:
    """Return the angle of rotation of a transform, 0 to pi."""
    (xx, _, _), (_, yy, _), (_, _, zz) = dst_SE3_src[:3, :3].tolist()
    return math.acos(min(max((xx + yy + zz - 1) / 2, -1.0), 1.0))


def is_rigid(dst_SE3_src: Float64, tolerance: float) -> Bool:
    """Tell which (..., 4, 4) transforms rotate, without scale, skew or mirror, to a tolerance of R R'."""
    rotation = dst_SE3_src[..., :3, :3]
    # Products of larger numbers may overflow.
    rotation = np.where(np.abs(rotation) < 2, rotation, 0.0)
    error = np.abs(rotation @ np.swapaxes(rotation, -1, -2) - np.eye(3)).max(axis=(-1, -2))
    return np.asarray((error <= tolerance) & (np.linalg.det(rotation) > 0))


def orthonormal(dst_SE3_src: Float64) -> Float64:
    """Return the transform with the rotation nearest to its 3x3 part, which rounding may skew."""
    left, _, right = np.linalg.svd(dst_SE3_src[:3, :3])
    flip = np.diag([1.0, 1.0, np.linalg.det(left @ right)])
    return from_rotation_translation(left @ flip @ right, dst_SE3_src[:3, 3])


def wrap(angle_rad: Float64 | float, period_rad: float = 2 * np.pi) -> Float64:
    """Return the same angle within half a period of 0."""
    return np.asarray((angle_rad + period_rad / 2) % period_rad - period_rad / 2)
