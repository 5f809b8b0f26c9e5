"""Boxes of one object over the drive: one size, places and headings that are smooth, and one box where it is parked."""

from dataclasses import dataclass

import numpy as np

from data.label_proposals.association import ACCELERATION_M_S2, deviations_m, is_static
from data.label_proposals.observations import Observations
from perception.detection.bev.classes import GROUPS
from perception.geometry.se3 import wrap
from perception.types import Bool, Boxes3D, Float64, Int

_DRIFT_M, _DRIFT_M_S2 = (
    0.6,
    0.02,
)  # of poses: distance that one box does not explain, and its acceleration
_SPEED_S = 7.5  # in which an object may have reached its speed
_OUTLIER = 3.0  # deviations
_COURSE_M_S = 1.0  # speed from which the course is the heading
_HEADING_FRAMES = 5


@dataclass(frozen=True)
class ObjectTrajectory:
    """Boxes of one object in frames that follow each other.

    Attributes:
        frames: (K,) frame indices, from its first to its last observation; of what stays where it is, all of the drive.
        boxes_world: (K) boxes in the world frame.
        is_observed: (K,) whether it was detected in the frame.
        is_moving: Whether it ever moves.
    """

    frames: Int
    boxes_world: Boxes3D
    is_observed: Bool
    is_moving: bool


def fit_trajectory(
    seen: Observations, frames: Int, stamps_s: Float64, size_share: float = 0.5
) -> ObjectTrajectory:
    """Return the boxes of one object.

    Args:
        seen: Its observations, one a frame at most.
        frames: (F,) indices of the frames of the drive.
        stamps_s: (F,) their times.
        size_share: Share of the observations, by weight, that are no larger than the object.
    """
    weights = seen.scores * np.sqrt(seen.points + 1.0)
    size_m = np.array(
        [_weighted_quantile(column, weights, size_share) for column in seen.boxes_world.size_m.T]
    )
    places = _anchored(seen, size_m)
    rests, group = is_static(seen, places), seen.groups[0]
    stays = rests & (group != GROUPS["Pedestrian"])
    lies_within = (frames >= seen.frames[0]) & (frames <= seen.frames[-1])
    states = _smoothed(
        seen, places, stamps_s[lies_within], _DRIFT_M_S2 if rests else ACCELERATION_M_S2[group]
    )
    axis_rad = _axis_rad(seen.boxes_world.yaw_rad, weights)
    yaw_rad = np.full(len(states), axis_rad) if rests else _headings_rad(axis_rad, states)
    bottoms_z = seen.boxes_world.bottom_m[:, 2]
    z = np.interp(stamps_s[lies_within], seen.stamps_s, _running_median(bottoms_z))
    if rests and np.ptp(states[:, :2], axis=0).max() < _DRIFT_M:
        states[:, :2] = [_weighted_quantile(column, weights) for column in places.T]
        z[:] = _weighted_quantile(bottoms_z, weights)
    middles = np.column_stack([states[:, :2], z])
    if stays:
        # It was there before, and is afterwards.
        rows = np.clip(np.arange(len(frames)) - lies_within.argmax(), 0, len(states) - 1)
        middles, yaw_rad, lies_within = middles[rows], yaw_rad[rows], np.ones(len(frames), bool)
    frames = frames[lies_within]
    boxes = Boxes3D(middles, np.tile(size_m, (len(frames), 1)), yaw_rad)
    return ObjectTrajectory(frames, boxes, np.isin(frames, seen.frames), not rests)


def _weighted_quantile(values: Float64, weights: Float64, share: float = 0.5) -> float:
    order = np.argsort(values)
    shares = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(shares, shares[-1] * share)])


def _anchored(seen: Observations, size_m: Float64) -> Float64:
    """Return the (K, 2) middles of boxes of another size, of which the sides towards the LiDAR stay."""
    boxes = seen.boxes_world
    cos, sin = np.cos(boxes.yaw_rad), np.sin(boxes.yaw_rad)
    x, y = (seen.sensors_world - boxes.bottom_m[:, :2]).T
    towards = np.column_stack([cos * x + sin * y, cos * y - sin * x])
    half_m = boxes.size_m[:, :2] / 2
    sides = np.where(np.abs(towards) > half_m, -np.sign(towards), 0.0)
    shifts = sides * (size_m[:2] / 2 - half_m)
    turned = np.column_stack(
        [cos * shifts[:, 0] - sin * shifts[:, 1], sin * shifts[:, 0] + cos * shifts[:, 1]]
    )
    return np.asarray(boxes.bottom_m[:, :2] + turned)


def _axis_rad(yaw_rad: Float64, weights: Float64) -> float:
    """Return the mean of headings, of which some may be those of the rear."""
    axis = np.angle((weights * np.exp(2j * yaw_rad)).sum()) / 2
    is_reversed = (weights * np.cos(yaw_rad - axis)).sum() < 0
    return float(wrap(np.array(axis + np.pi * is_reversed)))


def _smoothed(seen: Observations, places: Float64, stamps_s: Float64, noise: float) -> Float64:
    """Return (K, 4) places and velocities at times, by a Kalman filter and a Rauch-Tung-Striebel smoother.

    A second pass leaves out the places that are far from the first.
    """
    spreads_m = deviations_m(seen)
    rows = np.searchsorted(stamps_s, seen.stamps_s - 1e-6)
    states = _pass(rows, places, spreads_m, stamps_s, noise)
    away = np.linalg.norm(states[rows, :2] - places, axis=1) / spreads_m
    kept = away < _OUTLIER
    if kept.all() or kept.sum() < 3:
        return states
    return _pass(rows[kept], places[kept], spreads_m[kept], stamps_s, noise)


def _pass(
    rows: Int, places: Float64, spreads_m: Float64, stamps_s: Float64, noise: float
) -> Float64:
    count = len(stamps_s)
    place_of = dict(zip(rows.tolist(), range(len(rows)), strict=True))
    state = np.array([*places[0], 0.0, 0.0])
    covariance = np.diag([4.0, 4.0, *np.full(2, (_SPEED_S * noise) ** 2)])
    predicted, filtered = np.zeros((count, 4)), np.zeros((count, 4))
    before, after = np.zeros((count, 4, 4)), np.zeros((count, 4, 4))
    steps = np.zeros((count, 4, 4))
    for row in range(count):
        step_s = stamps_s[row] - stamps_s[row - 1] if row else 0.0
        step = np.eye(4)
        step[0, 2] = step[1, 3] = step_s
        gain = np.array([[step_s**2 / 2, 0], [0, step_s**2 / 2], [step_s, 0], [0, step_s]])
        state = step @ state
        covariance = step @ covariance @ step.T + noise**2 * gain @ gain.T
        steps[row], predicted[row], before[row] = step, state, covariance
        if (place := place_of.get(row)) is not None:
            innovation = covariance[:2, :2] + spreads_m[place] ** 2 * np.eye(2)
            kalman = np.linalg.solve(innovation, covariance[:2]).T
            state = state + kalman @ (places[place] - state[:2])
            covariance = covariance - kalman @ covariance[:2]
        filtered[row], after[row] = state, covariance
    smooth = filtered.copy()
    for row in range(count - 2, -1, -1):
        gain = np.linalg.solve(before[row + 1], steps[row + 1] @ after[row]).T
        smooth[row] = filtered[row] + gain @ (smooth[row + 1] - predicted[row + 1])
    return smooth


def _running_median(values: Float64) -> Float64:
    half = _HEADING_FRAMES // 2
    return np.array(
        [np.median(values[max(0, k - half) : k + half + 1]) for k in range(len(values))]
    )


def _headings_rad(axis_rad: float, states: Float64) -> Float64:
    """Return (K,) headings of a moving object: the course where it is fast, else its axis in the direction of the course."""
    velocities_m_s = states[:, 2:]
    speeds = np.linalg.norm(velocities_m_s, axis=1)
    course = np.arctan2(velocities_m_s[:, 1], velocities_m_s[:, 0])
    is_fast = speeds > _COURSE_M_S
    if not is_fast.any():
        way = velocities_m_s.sum(axis=0)
        is_back = np.linalg.norm(way) > 0 and np.cos(axis_rad - np.arctan2(way[1], way[0])) < -0.3
        return np.full(len(states), wrap(np.array(axis_rad + np.pi * is_back)))
    # The heading of a slow moment is that of the nearest fast one.
    fast = np.flatnonzero(is_fast)
    nearest = fast[np.abs(np.arange(len(states))[:, None] - fast).argmin(axis=1)]
    return np.asarray(course[nearest])
