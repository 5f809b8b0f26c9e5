"""Two motions of an object, of which one is true at a time: it stands, or it moves with a constant velocity.

A filter that knows only motion takes the jumps of a parked car's box for a velocity, and looks for it beside its place when it
is detected again. Here both motions are filtered, each observation tells how likely they are, and the state of a track is
their mean (interacting multiple models: Blom, Bar-Shalom, "The interacting multiple model algorithm", IEEE TAC 1988).
"""

from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np

from perception.tracking import motion_model
from perception.tracking.kalman import Gaussians
from perception.types import ArrayTable, Float64

_STANDS, _MOVES = 0, 1
_STOPPING_S, _STARTING_S = 10.0, 30.0  # mean times for which an object moves, and stands
_FIRST_STANDING = 0.5  # probability that an object stands which is observed for the first time
_MEMORY_S = 0.3  # time constant of the memory of a place, as boxes seen from one side err alike


@dataclass(frozen=True)
class MotionModes(ArrayTable):
    """Both motions of T tracks.

    Attributes:
        means: (T, 2, 4) x and y and the velocity if it stands, and if it moves.
        covariances: (T, 2, 4, 4) covariances of these.
        probabilities: (T, 2) probabilities of both.
    """

    means: Annotated[Float64, 2, 4]
    covariances: Annotated[Float64, 2, 4, 4]
    probabilities: Annotated[Float64, 2]

    @classmethod
    def init(cls, states: Gaussians) -> Self:
        """Return the motions of T states after one observation."""
        means, covariances = (
            np.repeat(one[:, None], 2, axis=1) for one in (states.mean, states.covariance)
        )
        first = np.tile([_FIRST_STANDING, 1 - _FIRST_STANDING], (len(states), 1))
        return cls(*_without_velocity(means, covariances), first)

    @property
    def merged(self) -> Gaussians:
        """(T) mean of both motions."""
        return _merged(self.means, self.covariances, self.probabilities)

    def predicted(self, elapsed_s: float) -> Self:
        """Return the motions after a time, in which objects may have stopped or started."""
        stopping, starting = (-np.expm1(-elapsed_s / one) for one in (_STOPPING_S, _STARTING_S))
        becomes = np.array([[1 - starting, starting], [stopping, 1 - stopping]])
        joint = self.probabilities[:, :, None] * becomes  # (T, before, after)
        probabilities = joint.sum(axis=1)
        shares = joint / probabilities[:, None]
        mixed = [
            _merged(self.means, self.covariances, shares[:, :, after])
            for after in (_STANDS, _MOVES)
        ]
        means, covariances = _without_velocity(
            np.stack([one.mean for one in mixed], axis=1),
            np.stack([one.covariance for one in mixed], axis=1),
        )
        moved = motion_model.predict(Gaussians(means[:, _MOVES], covariances[:, _MOVES]), elapsed_s)
        means[:, _MOVES], covariances[:, _MOVES] = moved.mean, moved.covariance
        covariances[:, _STANDS, :2, :2] *= np.exp(elapsed_s / _MEMORY_S)
        return type(self)(means, covariances, probabilities)

    def shifted(self, shift_m: Float64) -> Self:
        """Return the motions of places that are (T, 2) elsewhere."""
        return replace(self, means=self.means + np.pad(shift_m, ((0, 0), (0, 2)))[:, None])

    def squared_distances(self, centers_m: Float64, noise: Float64) -> Float64:
        """Return (T,) squared Mahalanobis distances of centres (T, 2) with noise (T, 2, 2), by the nearer motion."""
        by_motion = [
            motion_model.squared_distances(
                Gaussians(self.means[:, one], self.covariances[:, one]),
                centers_m[:, None],
                noise[:, None],
            )[:, 0]
            for one in (_STANDS, _MOVES)
        ]
        return np.minimum(*by_motion)

    def corrected(self, centers_m: Float64, noise: Float64) -> Self:
        """Return the motions after one centre (T, 2) each with its noise (T, 2, 2)."""
        count = len(self)
        flat = Gaussians(self.means.reshape(-1, 4), self.covariances.reshape(-1, 4, 4))
        centers_m, noise = np.repeat(centers_m, 2, axis=0), np.repeat(noise, 2, axis=0)
        spread = flat.covariance[:, :2, :2] + noise
        away = centers_m - flat.mean[:, :2]
        distances = (away[:, None] @ np.linalg.solve(spread, away[..., None]))[:, 0, 0]
        evidence = (-(distances + np.log(np.linalg.det(spread))) / 2).reshape(count, 2)
        likelihoods = np.exp(evidence - evidence.max(axis=1, keepdims=True)) * self.probabilities
        likelihoods = np.maximum(likelihoods, 1e-6)
        states = motion_model.correct(flat, centers_m, noise)
        return replace(
            self,
            means=states.mean.reshape(count, 2, 4),
            covariances=states.covariance.reshape(count, 2, 4, 4),
            probabilities=likelihoods / likelihoods.sum(axis=1, keepdims=True),
        )


def _without_velocity(means: Float64, covariances: Float64) -> tuple[Float64, Float64]:
    """Return both motions of which the first has no velocity."""
    means, covariances = means.copy(), covariances.copy()
    means[:, _STANDS, 2:] = 0.0
    covariances[:, _STANDS, 2:] = covariances[:, _STANDS, :, 2:] = 0.0
    return means, covariances


def _merged(means: Float64, covariances: Float64, shares: Float64) -> Gaussians:
    """Return the (T) Gaussians of the moments of (T, 2) ones."""
    mean = np.einsum("tm,tmi->ti", shares, means)
    off = means - mean[:, None]
    spread = covariances + off[..., None] * off[:, :, None]
    return Gaussians(mean, np.einsum("tm,tmij->tij", shares, spread))
