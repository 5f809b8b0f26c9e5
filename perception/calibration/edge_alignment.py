"""How well the edges of scans lie on those of images, and the change of the calibration with which they lie best."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from perception.calibration.frame_edges import FrameEdges, SweepTurn
from perception.calibration.image_edges import NEAREST_M
from perception.geometry.se3 import from_motion_vector
from perception.kernels.edge_sampling import add_map_sums
from perception.types import Float64

# Share of the decrease that the slope promises, from which a step is taken; the smallest share of a step that is tried.
_DECREASE, _MIN_SHARE = 1e-4, 1e-3
_MAX_STEPS = 60
# Maps are smoothed less and less: broad ones lead from afar, narrow ones to the place.
SMOOTHINGS_PX = (8.0, 4.0, 2.0)
# Offsets that change the image about as much.
STEP = np.array([np.radians(0.5)] * 3 + [0.05] * 3)
# Translations move far edges little: what no edge tells stays as it is.
TRANSLATION_PRIOR = np.array([0.0, 0.0, 0.0, 0.002, 0.002, 0.002])
# Steps up to which an offset is drawn back the more, the larger it is: 1 degree, 20 cm.
_TAIL = np.array([2.0] * 3 + [4.0] * 3)
_TOLERANCE = 2e-9
_CONTRAST_RAD = np.radians(1.5)
_PERCENT = 100.0
# How curved a loss in per cent is over these offsets, in street scenes of KITTI: a shift to the right looks like a turn about
# the axis down, and one down like one about the axis to the right.
_CURVATURE = np.diag([10.0, 40.0, 4.0, 11.0, 6.0, 4.0])
_CURVATURE[[1, 3], [3, 1]], _CURVATURE[[0, 4], [4, 0]] = 19.0, -6.0
_INVERSE_CURVATURE = np.linalg.inv(_CURVATURE)


def minimize_loss(
    loss: Callable[[Float64], tuple[float, Float64]],
    start: Float64,
    inverse_curvature: Float64,
    tolerance: float,
) -> Float64:
    """Return the (D,) place of the least loss that steps downhill lead to.

    Args:
        loss: Returns a smooth loss and its (D,) gradient at a (D,) place.
        start: (D,) place to start from.
        inverse_curvature: (D, D) inverse of the usual curvature, positive definite.
        tolerance: Share of the loss that a step must gain for another one.
    """
    place, (value, gradient), inverse = start, loss(start), inverse_curvature
    for _ in range(_MAX_STEPS):
        step = -inverse @ gradient
        promised, share = float(step @ gradient), 1.0
        later, later_gradient = loss(place + step)
        # False with NaN, and so a step into it is not taken.
        while not later <= value + _DECREASE * share * promised:
            share /= 2
            if share < _MIN_SHARE:
                return place
            later, later_gradient = loss(place + share * step)
        step = share * step
        gained, change = value - later, later_gradient - gradient
        place, value, gradient = place + step, later, later_gradient
        if gained <= tolerance * max(abs(value), 1.0):
            break
        inverse = _updated(inverse, step, change)
    return place


def _updated(inverse: Float64, step: Float64, change: Float64) -> Float64:
    """Return the inverse curvature by a step and the change of the gradient along it; as it was where that is bent away."""
    along = float(step @ change)
    if along <= 0:
        return inverse
    bent = inverse @ change
    pairs = np.outer(bent, step)
    by_step = (1 + change @ bent / along) / along * np.outer(step, step)
    return np.asarray(inverse + by_step - (pairs + pairs.T) / along)


@dataclass(frozen=True)
class AlignmentScore:
    """Score of an offset.

    Attributes:
        value: Mean of the image's edges at those of the scan, 0 to 1.
        gradient: (6,) change of the value with the offset.
        frame_gradients: (F, 6) change of the sum of the image's edges of each frame.
    """

    value: float
    gradient: Float64
    frame_gradients: Float64


class EdgeAlignment:
    """Edges of several frames, whose calibration differs by one offset."""

    def __init__(self, frames: Sequence[FrameEdges], turn: SweepTurn = SweepTurn.NONE) -> None:
        """Join the frames.

        Args:
            frames: Edges of each frame, at least one.
            turn: Direction in which the LiDAR turns.
        """
        self.frames = len(frames)
        self._frames, self._turn = tuple(frames), turn
        self.edges = sum(len(one.scan) for one in frames)

    def score(self, offset: Float64, smoothing_px: float) -> AlignmentScore:
        """Return how well the edges lie on each other with an offset."""
        moved_SE3_cam = from_motion_vector(offset)
        sums = np.zeros((self.frames, 7))
        for one, of_frame in zip(self._frames, sums, strict=True):
            add_map_sums(
                one.image.smoothed(smoothing_px), one.scan.is_upright, one.image.map_P_cam,
                one.points_cam(self._turn), moved_SE3_cam, NEAREST_M, of_frame,
            )  # fmt: skip
        mean = sums.sum(axis=0) / max(self.edges, 1)
        return AlignmentScore(float(mean[0]), mean[1:], sums[:, 1:])

    def align(
        self,
        start: Float64 | None = None,
        smoothings_px: Sequence[float] = SMOOTHINGS_PX,
        prior: Float64 = TRANSLATION_PRIOR,
        tolerance: float = _TOLERANCE,
    ) -> Float64:
        """Return the (6,) offset with the best score near a start.

        Args:
            start: (6,) offset to start from; else none.
            smoothings_px: Smoothings of the maps, one after another.
            prior: (6,) twice the score that an offset by one `STEP` in each direction must gain; far offsets are drawn
                back less, as they are no small errors of the mounting.
            tolerance: Share of the score that a step must gain for another one.
        """
        steps = np.zeros(6) if start is None else np.asarray(start, np.float64) / STEP
        for smoothing_px in smoothings_px:

            def loss(steps: Float64, smoothing_px: float = smoothing_px) -> tuple[float, Float64]:
                score = self.score(steps * STEP, smoothing_px)
                lost = prior_loss(steps * STEP, prior)
                gradient = prior * steps / (1 + np.square(steps / _TAIL)) - score.gradient * STEP
                return _PERCENT * (lost - score.value), _PERCENT * gradient

            steps = minimize_loss(loss, steps, _INVERSE_CURVATURE, tolerance)
        return np.asarray(steps * STEP, np.float64)

    def contrasts(self, offset: Float64, axes: Iterable[int], smoothing_px: float) -> Float64:
        """Return which share of the score is lost where an offset is turned by 1.5 degrees about each of some axes."""
        here = self.score(offset, smoothing_px).value
        turns = _CONTRAST_RAD * np.eye(6)
        turned = [
            max(self.score(offset + by, smoothing_px).value for by in (-turns[axis], turns[axis]))
            for axis in axes
        ]
        return 1 - np.array(turned) / here if here > 0 else np.zeros(len(turned))

    def covariance(self, offset: Float64) -> Float64:
        """Return the (6, 6) covariance of the best offset, by how much the frames differ from each other.

        That of an M-estimator, H^-1 (sum of g g^T over frames) H^-1, with the slope g of each frame's score and the
        curvature H of their sum; frames in a row see the same objects, and so are not as independent as it takes them.
        """
        slopes = self.score(offset, SMOOTHINGS_PX[1]).frame_gradients * STEP
        curvature = np.empty((6, 6))
        for axis in range(6):
            step = np.zeros(6)
            step[axis] = 0.5 * STEP[axis]
            ahead = self.score(offset + step, SMOOTHINGS_PX[1]).frame_gradients.sum(axis=0)
            behind = self.score(offset - step, SMOOTHINGS_PX[1]).frame_gradients.sum(axis=0)
            curvature[axis] = (behind - ahead) * STEP
        curvature = (curvature + curvature.T) / 2 + np.diag(self.edges * TRANSLATION_PRIOR)
        back = np.linalg.pinv(curvature)
        return np.asarray(STEP[:, None] * (back @ (slopes.T @ slopes) @ back) * STEP)


def prior_loss(offset: Float64, prior: Float64) -> float:
    """Return the score that a (6,) offset must gain by a (6,) prior of `EdgeAlignment.align`."""
    beyond = np.square(offset / STEP / _TAIL)
    return float(prior @ (np.square(_TAIL) * np.log1p(beyond))) / 2
