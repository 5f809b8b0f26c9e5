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
from perception.tracking.single_object.box.object_shape import CELL_M, ObjectShape, into_frame
from perception.tracking.single_object.box.observation import ObjectObservation
from perception.types import Bool, Float32, Float64

REACH = 2.5  # half size of the coarse lattice, in standard deviations of the prediction
_COARSE_STEPS = (25, 25, 7)  # maximum number along the heading, across it, and in yaw
_COARSE_SPACING = 0.15  # spacing of the coarse lattice, as a share of the object's length and width
_COARSE_SPACING_RAD = 0.07  # spacing of the coarse lattice in yaw
_FINE_STEPS = ((9, 9, 7), (7, 7, 7))  # numbers of steps of the finer lattices
# Half sizes along, across and in yaw: of the coarse lattice at least and at most, of finer ones at
# least.
_MIN_REACH, _MAX_REACH = np.array([0.25, 0.25, 0.06]), np.array([6.0, 6.0, np.pi / 2])
_FINEST = np.array([0.04, 0.04, 0.01])
_OWN_REWARD = 0.2  # minimum reward of a point that is the object's
_SATURATION_POINTS = 15.0  # number of points beyond which more points add no information
_SHARPNESS = 3.0  # log-likelihood of one point at the full reward
_SURPLUS_WEIGHT = 3.0  # log-likelihood of e times the expected reward
_MAX_POINTS = 250  # maximum number of points of one lattice; more are thinned out
_SCORE_MARGIN = 6.0  # maximum difference in log-likelihood of poses that are averaged
# Minimum standard deviations along, across and in yaw.
_MIN_DEVIATIONS = np.array([0.03, 0.03, 0.015])


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
) -> PoseEstimate:
    """Return the estimate of the pose after a scan.

    Args:
        shape: Shape of the object.
        observation: Observed points of the scan.
        priors: Predicted poses, a mixture in equal parts; the first is the centre of the search.
        expected_reward: Expected reward of the object's points at this distance.
    """
    table = shape.rewards(observation.sensor_xy_m, priors[0].pose)
    lattice = _first_lattice(priors[0], shape)
    for steps in (*_FINE_STEPS, None):
        smooth = _blurred(table, lattice.spacing[:2].max() / 2 / CELL_M)
        reach_m = shape.radius_m + float(np.hypot(*lattice.reach[:2]))
        near = observation.near(lattice.pose[:2], reach_m, _MAX_POINTS)
        scored = _score_poses(shape, smooth, near, lattice)
        kept = expected_reward * shape.retained_share(smooth, table)
        score = _log_likelihood(scored.rewards, kept) + _log_prior(scored.poses, priors)
        best = np.unravel_index(np.argmax(score), score.shape)
        expected_reward = max(expected_reward, float(scored.rewards[best]))
        estimate = _moments(scored.poses, score, _around_best(score, best))
        if steps is not None:
            lattice = _finer(lattice, estimate, steps)
    axes = _turn(estimate.pose[2])
    floor = axes @ np.diag(_MIN_DEVIATIONS**2) @ axes.T
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
        top_m=float(observation.tops_m[worth > _OWN_REWARD].max(initial=-np.inf)),
    )


def _first_lattice(prior: PoseEstimate, shape: ObjectShape) -> _Lattice:
    spread = _spread(prior.pose[2], prior.covariance)
    reach = np.clip(REACH * spread, _MIN_REACH, _MAX_REACH)
    length_m, width_m = np.clip(_COARSE_SPACING * shape.size_m[:2], 0.1, 0.3)
    spacing = np.array([length_m, width_m, _COARSE_SPACING_RAD])
    along, across, around = np.clip(2 * np.ceil(reach / spacing) + 1, 5, _COARSE_STEPS)
    return _Lattice(prior.pose, reach, (int(along), int(across), int(around)))


def _finer(lattice: _Lattice, estimate: PoseEstimate, steps: tuple[int, int, int]) -> _Lattice:
    spread = _spread(estimate.pose[2], estimate.covariance)
    reach = np.minimum(np.maximum(2.5 * spread, 1.5 * lattice.spacing), lattice.reach)
    return _Lattice(estimate.pose, np.maximum(reach, _FINEST), steps)


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
    per_m = 1 / CELL_M
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


def _log_likelihood(rewards: Float64, expected_reward: float) -> Float64:
    """Return the log-likelihood of poses by their rewards; a surplus over the expected reward adds little."""
    expected = max(expected_reward, 1.0)
    surplus = _SURPLUS_WEIGHT * np.log(np.maximum(rewards, expected) / expected)
    share = _SHARPNESS * min(1.0, _SATURATION_POINTS / expected)
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


def _around_best(score: Float64, best: tuple[np.intp, ...]) -> Bool:
    """Return the possible poses that are connected with the best one: those of another object are not."""
    groups, _ = ndimage.label(score > score[best] - _SCORE_MARGIN, np.ones((3, 3, 3)))
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
