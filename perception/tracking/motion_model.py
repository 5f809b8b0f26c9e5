"""Constant-velocity motion of tracked objects over the ground, and the noise of their observed centres.

state      x  y  vx  vy      (world)
measured   x  y              centre of the box
"""

import numpy as np

from perception.tracking import kalman
from perception.tracking.kalman import Gaussians, States
from perception.types import Float64, Int

_VELOCITY_NOISE_M_S = 0.9  # change of velocity within a second, along x and along y
_INITIAL_SPEED_M_S, _SMALL_INITIAL_SPEED_M_S = 6.0, 3.0  # along x and along y
_SMALL_LENGTH_M = 1.3  # maximum length and width of pedestrians and cyclists
_SIDE_NOISE_M = 0.06  # of an observed side, from pose, range, and swinging arms
_SAMPLING = 0.5  # share of the size, over the root of the number of points, that an end lacks
_SLACK_SHARE = 0.3  # deviation of the centre in what is not observed; 0.29 if it is uniform
GATE = 9.21  # maximum squared distance of a true pair (99 %, chi-squared, 2 degrees of freedom)
_BOX_ERROR_M = 0.05  # of a centre that no number of observations removes: a sparse side
_VELOCITY_INFLATION = 0.4  # of reported variances: most keep their velocity, unknown to the filter

_OBSERVATION = np.eye(2, 4)


def predict(states: States, elapsed_s: float) -> States:
    """Predict the states, with random accelerations.

    The noise of two steps is that of one step as long as both, so that neither the scan rate nor a gap in time changes
    the covariance.
    """
    transition, position, speed = np.eye(4), slice(0, 2), slice(2, 4)
    transition[position, speed] = elapsed_s * np.eye(2)
    noise = np.zeros((4, 4))
    noise[position, position] = elapsed_s**3 / 3 * np.eye(2)
    noise[position, speed] = noise[speed, position] = elapsed_s**2 / 2 * np.eye(2)
    noise[speed, speed] = elapsed_s * np.eye(2)
    return kalman.predict(states, transition, _VELOCITY_NOISE_M_S**2 * noise)


def init(positions_m: Float64, noise: Float64, sizes_m: Float64) -> Gaussians:
    """Return the states after one observation.

    Args:
        positions_m: (T, 2) observed positions.
        noise: (T, 2, 2) covariances of the positions.
        sizes_m: (T, 2) observed lengths and widths.
    """
    count = len(positions_m)
    is_small = sizes_m.max(axis=1) < _SMALL_LENGTH_M
    speed_m_s = np.where(is_small, _SMALL_INITIAL_SPEED_M_S, _INITIAL_SPEED_M_S)
    covariance = np.zeros((count, 4, 4))
    covariance[:, :2, :2] = noise
    covariance[:, 2:, 2:] = speed_m_s[:, None, None] ** 2 * np.eye(2)
    return Gaussians(np.hstack([positions_m, np.zeros((count, 2))]), covariance)


def position_noise(
    seen_m: Float64, swing_m: Float64, slack_m: Float64, points: Int, yaw_rad: Float64
) -> Float64:
    """Return (..., 2, 2) the noise of centres over the ground plane.

    Args:
        seen_m: (..., 2) observed length and width, whose ends lie between points.
        swing_m: (..., 2) shift of the centre along the heading and to the left, by an error of the heading.
        slack_m: (..., 2) difference of observed and estimated length and width.
        points: (...) numbers of observed points; more points locate a side better.
        yaw_rad: (...) headings.
    """
    missed_m, slack_m = _SAMPLING * seen_m / np.sqrt(points)[..., None], _SLACK_SHARE * slack_m
    return turned_variances(_SIDE_NOISE_M**2 + missed_m**2 + swing_m**2 + slack_m**2, yaw_rad)


def turned_variances(variances: Float64, yaw_rad: Float64) -> Float64:
    """Return (..., 2, 2) the covariances of x and y by (..., 2) variances along headings and to their left."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    along, left = variances[..., 0], variances[..., 1]
    turned = np.empty((*along.shape, 2, 2))
    turned[..., 0, 0] = cos**2 * along + sin**2 * left
    turned[..., 1, 1] = sin**2 * along + cos**2 * left
    turned[..., 0, 1] = turned[..., 1, 0] = cos * sin * (along - left)
    return turned


def squared_distances(states: Gaussians, centers_m: Float64, noise: Float64) -> Float64:
    """Return (T, F) squared Mahalanobis distances of centres (T, F, 2) with noise (T, F, 2, 2)."""
    return kalman.mahalanobis_squared(states, centers_m, _OBSERVATION, noise)


def correct(states: States, centers_m: Float64, noise: Float64) -> States:
    """Correct each state by one centre (T, 2) with its noise (T, 2, 2)."""
    return kalman.update(states, centers_m, _OBSERVATION, noise)


def reported_covariances(states: Gaussians) -> Float64:
    """Return (T, 4, 4) covariances to report of observed centres and of velocities."""
    ratios = np.repeat([1.0, _VELOCITY_INFLATION], 2)
    inflated = states.covariance * np.sqrt(np.outer(ratios, ratios))
    return np.asarray(inflated + np.diag([_BOX_ERROR_M**2] * 2 + [0.0] * 2))


def moves_alike(states: Gaussians, first: int, second: int) -> bool:
    """Return whether two of T states have one velocity, within their uncertainty."""
    apart_m_s = states.mean[first, 2:] - states.mean[second, 2:]
    covariance = states.covariance[first, 2:, 2:] + states.covariance[second, 2:, 2:]
    return bool(apart_m_s @ np.linalg.solve(covariance, apart_m_s) <= GATE)
