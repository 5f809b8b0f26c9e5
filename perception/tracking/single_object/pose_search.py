"""Where a shape fits the points best around an expected pose, and how sure that is.

The poses of a lattice around the expected one are all judged at once; the next, finer lattice covers
what the first left possible. The answer is the mean and the covariance of what is left, so that a long
wall, along which a pose may slide, says nothing about the place along it.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from perception.tracking.single_object.object_shape import ObjectShape
from perception.types import Float32, Float64, Int


@dataclass(frozen=True)
class SearchRules:
    """How poses are searched.

    Attributes:
        steps: of the lattices along the heading, across and around, coarse to fine.
        reach: of the first lattice in standard deviations of what is expected.
        least_reach_m: of the first lattice along and across.
        least_reach_rad: around.
        finest_m: steps need not be finer.
        finest_rad: the same of angles.
        informative_points: so many points say all; more say the same again.
        sharpness: of one such point.
        surplus: what e times as many points as usual say.
        most_points: of one lattice; more are thinned evenly.
        floor_m: standard deviation of a pose that fits perfectly.
        floor_rad: of its yaw.
    """

    steps: tuple[tuple[int, int, int], ...] = ((13, 9, 7), (9, 9, 7), (7, 7, 7))
    reach: float = 2.5
    least_reach_m: float = 0.25
    least_reach_rad: float = 0.06
    finest_m: float = 0.02
    finest_rad: float = 0.005
    informative_points: float = 40.0
    sharpness: float = 3.0
    surplus: float = 3.0
    most_points: int = 250
    floor_m: float = 0.03
    floor_rad: float = 0.015


@dataclass(frozen=True)
class PoseBelief:
    """Where the object is.

    Attributes:
        pose: (3,) x, y, yaw.
        covariance: (3, 3).
        reward: of all points together that speak for this pose, each worth up to 1.
    """

    pose: Float64
    covariance: Float64
    reward: float


def search(
    shape: ObjectShape,
    points_xy_m: Float64,
    weights: Float64,
    sensor_xy_m: Float64,
    priors: tuple[PoseBelief, ...],
    usual_reward: float,
    rules: SearchRules,
) -> PoseBelief:
    """Return what is believed after (N, 2) points were seen.

    Args:
        shape: of the object.
        points_xy_m: above the ground, all around the expected place.
        weights: (N,) of the points.
        sensor_xy_m: (2,).
        priors: what is expected: the first, or one of the others.
        usual_reward: of the object at this distance.
        rules: how to search.
    """
    expected = priors[0]
    table = shape.rewards(into_frame(sensor_xy_m[None], expected.pose)[0])
    pose = expected.pose
    axes = _turn(pose[2])
    spread = np.sqrt(np.diag(axes.T @ expected.covariance @ axes))
    least = np.array([rules.least_reach_m, rules.least_reach_rad])[[0, 0, 1]]
    reach = np.maximum(rules.reach * spread, least)
    finest = np.array([rules.finest_m, rules.finest_rad])[[0, 0, 1]]
    for steps in rules.steps:
        spacing = 2 * reach / (np.array(steps) - 1)
        smooth = _blurred(table, max(spacing[0], spacing[1]) / 2 / shape.rules.cell_m)
        rows, boost = _within_reach(shape, points_xy_m, pose, reach, rules.most_points)
        poses, sums = _judge(
            shape, smooth, points_xy_m[rows], weights[rows] * boost, pose, reach, steps
        )
        gain = _gains(sums, usual_reward, rules)
        off = poses - expected.pose
        off[:, 2] = _wrap(off[:, 2])
        score = gain + _log_prior(poses, priors)
        usual_reward = max(usual_reward, float(sums[np.argmax(score)]))
        chances = np.exp(score - score.max())
        chances /= chances.sum()
        mean_off = chances @ off
        pose = expected.pose + mean_off
        rest = off - mean_off
        covariance = (rest * chances[:, None]).T @ rest
        axes = _turn(pose[2])
        spread = np.sqrt(np.maximum(np.diag(axes.T @ covariance @ axes), 0))
        reach = np.minimum(np.maximum(2.5 * spread, 1.5 * spacing), reach)
        reach = np.maximum(reach, finest * 2)
    floor = axes @ np.diag([rules.floor_m**2, rules.floor_m**2, rules.floor_rad**2]) @ axes.T
    return PoseBelief(pose, covariance + floor, reward_at(shape, table, points_xy_m, weights, pose))


def _within_reach(
    shape: ObjectShape, points_xy_m: Float64, pose: Float64, reach: Float64, most: int
) -> tuple[Int, float]:
    """Return which points any pose of a lattice may touch, thinned evenly, and what each stands for."""
    radius_m = np.hypot(*(shape.size_m[:2] / 2 + shape.rules.rim_m)) + np.hypot(*reach[:2])
    off = points_xy_m - pose[:2]
    rows = np.flatnonzero((off**2).sum(axis=1) < radius_m**2)
    stride = max(1, -(-len(rows) // most))
    return rows[::stride], float(stride)


def reward_at(
    shape: ObjectShape, table: Float32, points_xy_m: Float64, weights: Float64, pose: Float64
) -> float:
    """Return how much speaks for one pose."""
    u, v = shape.cells_of(*into_frame(points_xy_m, pose).T)
    rows, columns = table.shape
    i = np.clip(np.rint(u), 0, rows - 1).astype(np.int64)
    j = np.clip(np.rint(v), 0, columns - 1).astype(np.int64)
    return float(weights @ np.maximum(table[i, j], 0))


def _log_prior(poses: Float64, priors: tuple[PoseBelief, ...]) -> Float64:
    """Return (H,) the log density of a mixture of beliefs in equal parts, but for a constant."""
    logs = []
    for prior in priors:
        off = poses - prior.pose
        off[:, 2] = _wrap(off[:, 2])
        away = np.einsum("hi,ij,hj->h", off, np.linalg.inv(prior.covariance), off)
        logs.append(-0.5 * (away + np.linalg.slogdet(prior.covariance)[1]))
    return np.asarray(np.logaddexp.reduce(logs))


def _gains(sums: Float64, usual_reward: float, rules: SearchRules) -> Float64:
    """Return what rewards say for poses; more than is usual for the object says little more."""
    usual = max(usual_reward, 1.0)
    beyond = rules.surplus * np.log(np.maximum(sums, usual) / usual)
    share = rules.sharpness * min(1.0, rules.informative_points / usual)
    return np.asarray(share * np.minimum(sums, usual) + beyond)


def _judge(
    shape: ObjectShape,
    table: Float32,
    points_xy_m: Float64,
    weights: Float64,
    pose: Float64,
    reach: Float64,
    steps: tuple[int, int, int],
) -> tuple[Float64, Float64]:
    """Return (H, 3) poses of a lattice and (H,) the summed rewards of all points at each."""
    along, across, around = (np.linspace(-r, r, n) for r, n in zip(reach, steps, strict=True))
    yaws = pose[2] + around
    cos, sin = np.cos(yaws)[:, None], np.sin(yaws)[:, None]
    x, y = (points_xy_m - pose[:2]).T
    u, v = shape.cells_of(cos * x + sin * y, cos * y - sin * x)  # (yaws, N)
    rows, columns = table.shape
    cell = 1 / shape.rules.cell_m
    i = np.clip(np.rint(u[..., None] - cell * along), 0, rows - 1).astype(np.int32) * columns
    j = np.clip(np.rint(v[..., None] - cell * across), 0, columns - 1).astype(np.int32)
    worth = table.ravel().take(i[:, :, :, None] + j[:, :, None, :])  # (yaws, N, along, across)
    sums = np.einsum("n,ynuv->yuv", weights.astype(np.float32), worth)
    cos, sin = cos[:, :, None], sin[:, :, None]
    du, dv = along[None, :, None], across[None, None, :]
    places = np.stack(
        [
            pose[0] + cos * du - sin * dv,
            pose[1] + sin * du + cos * dv,
            np.broadcast_to(yaws[:, None, None], sums.shape),
        ],
        axis=-1,
    )
    return places.reshape(-1, 3), sums.ravel().astype(np.float64)


def _blurred(table: Float32, deviation_cells: float) -> Float32:
    if deviation_cells < 0.6:
        return table
    return np.asarray(cv2.GaussianBlur(table, (0, 0), deviation_cells))


def into_frame(points_xy_m: Float64, pose: Float64) -> Float64:
    """Return (N, 2) places along and left of a pose."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x, y = (points_xy_m - pose[:2]).T
    return np.column_stack([cos * x + sin * y, cos * y - sin * x])


def _turn(yaw_rad: float) -> Float64:
    """Return (3, 3) the axes along, across and around as columns."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def _wrap(angle_rad: Float64) -> Float64:
    return np.asarray((angle_rad + np.pi) % (2 * np.pi) - np.pi)
