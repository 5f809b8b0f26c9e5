"""Search of the pose at which an object's shape fits the points best, and of its covariance.

The poses of a lattice around the predicted one are scored at once; the next, finer lattice covers the poses that remain
possible. The result is the mean and the covariance of these, so that a long wall, along which a pose may slide, does
not determine the position along it.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage

from perception.geometry.se3 import wrap
from perception.tracking.single_object.box.object_shape import ObjectShape, into_frame
from perception.tracking.single_object.box.observation import ObjectObservation
from perception.tracking.single_object.config import PoseSearchConfig
from perception.types import Bool, Float32, Float64


@dataclass(frozen=True)
class PoseEstimate:
    """Pose of the object in the world, (3,) x, y, yaw, and its (3, 3) covariance."""

    pose: Float64
    covariance: Float64


def squared_distance(estimate: PoseEstimate, prior: PoseEstimate) -> float:
    """Return the squared Mahalanobis distance of an estimate from the predicted pose."""
    off = estimate.pose - prior.pose
    off[2] = wrap(off[2])
    return float(off @ np.linalg.solve(prior.covariance, off))


@dataclass(frozen=True)
class _Lattice:
    """Poses around one, within a reach along, across and around it, in some numbers of steps."""

    pose: Float64
    reach: Float64
    steps: tuple[int, int, int]

    @property
    def spacing(self) -> Float64:
        return np.asarray(2 * self.reach / (np.array(self.steps) - 1))


@dataclass(frozen=True)
class _ScoredPoses:
    """Poses of a lattice, (Y, U, V, 3) around, along and across, and their (Y, U, V) rewards."""

    poses: Float64
    rewards: Float64


def search(
    shape: ObjectShape,
    observation: ObjectObservation,
    priors: tuple[PoseEstimate, ...],
    expected_reward: float,
    config: PoseSearchConfig,
) -> PoseEstimate:
    """Return the estimate of the pose after a scan.

    Args:
        shape: Shape of the object.
        observation: Observed points of the scan.
        priors: Predicted poses, a mixture in equal parts; the first is the centre of the search.
        expected_reward: Expected reward of the object's points at this distance.
        config: Lattices and likelihood.
    """
    table = shape.rewards(observation.sensor_xy_m, priors[0].pose)
    lattice = _first_lattice(priors[0], shape, config)
    for steps in (*config.fine_steps, None):
        smooth = _blurred(table, lattice.spacing[:2].max() / 2 / shape.config.cell_m)
        reach_m = shape.radius_m + float(np.hypot(*lattice.reach[:2]))
        near = observation.near(lattice.pose[:2], reach_m, config.max_points)
        scored = _score_poses(shape, smooth, near, lattice)
        kept = expected_reward * shape.retained_share(smooth, table)
        score = _log_likelihood(scored.rewards, kept, config) + _log_prior(scored.poses, priors)
        best = np.unravel_index(np.argmax(score), score.shape)
        expected_reward = max(expected_reward, float(scored.rewards[best]))
        estimate = _moments(scored.poses, score, _around_best(score, best, config.score_margin))
        if steps is not None:
            lattice = _finer(lattice, estimate, steps, config)
    axes = _turn(estimate.pose[2])
    deviations = [config.min_deviation_m, config.min_deviation_m, config.min_deviation_rad]
    floor = axes @ np.diag(np.square(deviations)) @ axes.T
    return PoseEstimate(estimate.pose, estimate.covariance + floor)


@dataclass(frozen=True)
class Support:
    """Evidence of the points for one pose.

    Attributes:
        reward: Sum of the rewards of points, each at most 1.
        penalty: Sum of the penalties of points.
        top_m: Height (z) of the highest point of the object; -inf without one.
    """

    reward: float
    penalty: float
    top_m: float


def support_at(shape: ObjectShape, observation: ObjectObservation, pose: Float64) -> Support:
    """Return the evidence for and against one pose."""
    table = shape.rewards(observation.sensor_xy_m, pose)
    u, v = shape.cells_of(*into_frame(observation.points_xy_m, pose).T)
    rows, columns = table.shape
    i = np.clip(np.rint(u), 0, rows - 1).astype(np.int64)
    j = np.clip(np.rint(v), 0, columns - 1).astype(np.int64)
    worth = table[i, j]
    return Support(
        reward=float(observation.weights @ np.maximum(worth, 0)),
        penalty=float(observation.weights @ np.maximum(-worth, 0)),
        top_m=float(observation.tops_m[worth > shape.config.own_reward].max(initial=-np.inf)),
    )


def _first_lattice(prior: PoseEstimate, shape: ObjectShape, config: PoseSearchConfig) -> _Lattice:
    least = np.array([config.min_reach_m, config.min_reach_m, config.min_reach_rad])
    most = np.array([config.max_reach_m, config.max_reach_m, np.pi / 2])
    spread = _spread(prior.pose[2], prior.covariance)
    reach = np.clip(config.reach * spread, least, most)
    length_m, width_m = np.clip(config.coarse_spacing * shape.size_m[:2], 0.1, 0.3)
    spacing = np.array([length_m, width_m, config.coarse_spacing_rad])
    along, across, around = np.clip(2 * np.ceil(reach / spacing) + 1, 5, config.coarse_steps)
    return _Lattice(prior.pose, reach, (int(along), int(across), int(around)))


def _finer(
    lattice: _Lattice, estimate: PoseEstimate, steps: tuple[int, int, int], config: PoseSearchConfig
) -> _Lattice:
    spread = _spread(estimate.pose[2], estimate.covariance)
    reach = np.minimum(np.maximum(2.5 * spread, 1.5 * lattice.spacing), lattice.reach)
    finest = np.array([config.finest_m, config.finest_m, config.finest_rad])
    return _Lattice(estimate.pose, np.maximum(reach, finest), steps)


def _score_poses(
    shape: ObjectShape, table: Float32, observation: ObjectObservation, lattice: _Lattice
) -> _ScoredPoses:
    """Sum the rewards of all points at every pose.

    Steps along and across lie on the pose's own axes, so that the cells of a point along and across
    need only be added.
    """
    along, across, around = (
        np.linspace(-reach, reach, steps)
        for reach, steps in zip(lattice.reach, lattice.steps, strict=True)
    )
    x0, y0, yaw0 = lattice.pose
    yaws = yaw0 + around
    cos, sin = np.cos(yaws)[:, None], np.sin(yaws)[:, None]
    x, y = (observation.points_xy_m - [x0, y0]).T
    u, v = shape.cells_of(cos * x + sin * y, cos * y - sin * x)
    rows, columns = table.shape
    per_m = 1 / shape.config.cell_m
    i = np.clip(np.rint(u[..., None] - per_m * along), 0, rows - 1).astype(np.int32)
    j = np.clip(np.rint(v[..., None] - per_m * across), 0, columns - 1).astype(np.int32)
    worth = table.ravel().take((i * np.int32(columns))[:, :, :, None] + j[:, :, None, :])
    rewards = np.einsum("n,ynuv->yuv", observation.weights.astype(np.float32), worth)
    cos, sin = cos[:, :, None], sin[:, :, None]
    du, dv = along[None, :, None], across[None, None, :]
    poses = np.stack(
        [
            x0 + cos * du - sin * dv,
            y0 + sin * du + cos * dv,
            np.broadcast_to(yaws[:, None, None], rewards.shape),
        ],
        axis=-1,
    )
    return _ScoredPoses(poses, rewards.astype(np.float64))


def _log_likelihood(rewards: Float64, expected_reward: float, config: PoseSearchConfig) -> Float64:
    """Return the log-likelihood of poses by their rewards; a surplus over the expected reward adds little."""
    expected = max(expected_reward, 1.0)
    surplus = config.surplus_weight * np.log(np.maximum(rewards, expected) / expected)
    share = config.sharpness * min(1.0, config.saturation_points / expected)
    return np.asarray(share * np.minimum(rewards, expected) + surplus)


def _log_prior(poses: Float64, priors: tuple[PoseEstimate, ...]) -> Float64:
    """Return (...) the log density of a mixture of estimates in equal parts, but for a constant."""
    logs = []
    for prior in priors:
        off = poses - prior.pose
        off[..., 2] = wrap(off[..., 2])
        away = np.einsum("...i,ij,...j->...", off, np.linalg.inv(prior.covariance), off)
        logs.append(-0.5 * (away + np.linalg.slogdet(prior.covariance)[1]))
    return np.asarray(np.logaddexp.reduce(logs))


def _around_best(score: Float64, best: tuple[np.intp, ...], score_margin: float) -> Bool:
    """Return the possible poses that are connected with the best one: those of another object are not."""
    groups, _ = ndimage.label(score > score[best] - score_margin, np.ones((3, 3, 3)))
    return np.asarray(groups == groups[best])


def _moments(poses: Float64, score: Float64, rows: Bool) -> PoseEstimate:
    """Return mean and covariance of some poses, weighted by their likelihood."""
    chosen, score = poses[rows], score[rows]
    chances = np.exp(score - score.max())
    chances /= chances.sum()
    mean = chances @ chosen  # yaws of one lattice do not wrap
    off = chosen - mean
    return PoseEstimate(mean, (off * chances[:, None]).T @ off)


def _blurred(table: Float32, deviation_cells: float) -> Float32:
    if deviation_cells < 0.6:
        return table
    blurred = np.asarray(cv2.GaussianBlur(table, (0, 0), deviation_cells), np.float32)
    blurred[[0, -1]] = blurred[:, [0, -1]] = 0.0  # the cells of all points that lie farther away
    return blurred


def _spread(yaw_rad: float, covariance: Float64) -> Float64:
    """Return (3,) the standard deviations along, across and around."""
    axes = _turn(yaw_rad)
    return np.sqrt(np.maximum(np.diag(axes.T @ covariance @ axes), 0))


def _turn(yaw_rad: float) -> Float64:
    """Return (3, 3) the axes along, across and around as columns."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
