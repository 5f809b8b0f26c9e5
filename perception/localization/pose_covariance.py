"""Covariances of poses: x, y, z in metres, then a rotation vector in rad, along the axes of the world frame.

What a pose is registered with is uncertain itself, and its rotation moves the pose along an arc around it.
"""

import numpy as np

from perception.geometry.se3 import cross_matrix
from perception.types import Float, Float64

# Standard deviations of a second without registration, in metres and rad: of a motion carried on, and of one never known.
_CARRIED_ON, _NEVER_KNOWN = (1.0, 0.02), (15.0, 0.35)
_SHORTEST_S = 0.1


def registered_covariance(
    of_keyframe: Float64, world_SE3_keyframe: Float64, of_motion: Float64, world_SE3_velo: Float64
) -> Float64:
    """Return the (6, 6) covariance of a pose that was registered with a keyframe.

    Args:
        of_keyframe: (6, 6) covariance of the pose of the keyframe.
        world_SE3_keyframe: (4, 4) pose of the keyframe.
        of_motion: (6, 6) covariance of the motion between both, as of `Alignment`.
        world_SE3_velo: (4, 4) pose of the scan.
    """
    away_m = world_SE3_velo[:3, 3] - world_SE3_keyframe[:3, 3]
    turn = np.kron(np.eye(2), world_SE3_keyframe[:3, :3])
    # From rotation and translation in the frame of the keyframe to position and rotation of the scan.
    lever = np.block([[-cross_matrix(away_m), np.eye(3)], [np.eye(3), np.zeros((3, 3))]])
    of_scan = lever @ turn
    return np.asarray(carried_covariance(of_keyframe, away_m) + of_scan @ of_motion @ of_scan.T)


def unregistered_covariance(
    of_last: Float64,
    world_SE3_last: Float64,
    world_SE3_velo: Float64,
    gap_s: float,
    *,
    has_motion: bool = True,
) -> Float64:
    """Return the (6, 6) covariance of a pose that the INS or the velocity carried on from the last.

    Args:
        of_last: (6, 6) covariance of the last pose.
        world_SE3_last: (4, 4) last pose.
        world_SE3_velo: (4, 4) pose.
        gap_s: Time between the two in seconds.
        has_motion: Whether the INS or a velocity tells the motion between both.
    """
    deviations = np.repeat(_CARRIED_ON if has_motion else _NEVER_KNOWN, 3) * max(gap_s, _SHORTEST_S)
    return carried_covariance(of_last, world_SE3_velo[:3, 3] - world_SE3_last[:3, 3]) + np.diag(
        deviations**2
    )


def plane_covariances_m2(covariance: Float64, away_m: Float) -> Float64:
    """Return the (P, 2, 2) covariances over the ground plane that a pose gives to places around it.

    Args:
        covariance: (6, 6) covariance of the pose.
        away_m: (P, 2+) places from the LiDAR along the axes of the world.
    """
    moved = np.zeros((len(away_m), 2, 3))
    moved[:, 0, 0] = moved[:, 1, 1] = 1.0
    moved[:, 0, 2], moved[:, 1, 2] = -away_m[:, 1], away_m[:, 0]
    level = [0, 1, 5]
    return np.asarray(moved @ covariance[np.ix_(level, level)] @ moved.transpose(0, 2, 1))


def plane_deviations_m(covariance: Float64, ranges_m: Float) -> Float:
    """Return the (P,) largest standard deviations over the ground plane that a pose gives to places at (P,) ranges."""
    turn, sideways = covariance[5, 5], 2 * float(np.hypot(covariance[0, 5], covariance[1, 5]))
    variances = covariance[0, 0] + covariance[1, 1] + ranges_m * (sideways + ranges_m * turn)
    return np.asarray(np.sqrt(variances))


def carried_covariance(covariance: Float64, away_m: Float64) -> Float64:
    """Return what the (6, 6) covariance of a pose makes of one at a (3,) distance from it."""
    lever = np.block([[np.eye(3), -cross_matrix(away_m)], [np.zeros((3, 3)), np.eye(3)]])
    return np.asarray(lever @ covariance @ lever.T)
