"""Kalman filters in batches: T filters of n states each, every step one computation.

The functions are pure: a state goes in, a new one comes out. Time step, noise and measurement are
arguments, so that one file serves every motion model.

    mean (T, n)   covariance (T, n, n)   transition (n, n)   process noise (n, n) or (T, n, n)
    measured (T, k)   observation (k, n)   measurement noise (k, k) or (T, k, k)
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class Gaussians:
    """The states of T filters.

    Attributes:
        mean: (T, n).
        covariance: (T, n, n).
    """

    mean: Float64
    covariance: Float64

    def __len__(self) -> int:
        """Return T."""
        return len(self.mean)

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the filters of a mask, of indices, or of a slice."""
        return type(self)(self.mean[rows], self.covariance[rows])

    def joined(self, others: Self) -> Self:
        """Return these filters and others after them."""
        return type(self)(
            np.concatenate([self.mean, others.mean]),
            np.concatenate([self.covariance, others.covariance]),
        )

    def replaced(self, rows: Int, others: Self) -> Self:
        """Return these filters with others in the place of some rows."""
        mean, covariance = self.mean.copy(), self.covariance.copy()
        mean[rows], covariance[rows] = others.mean, others.covariance
        return type(self)(mean, covariance)


def predict(states: Gaussians, transition: Float64, process_noise: Float64) -> Gaussians:
    """Move every state one step ahead."""
    return Gaussians(
        states.mean @ transition.T,
        transition @ states.covariance @ transition.T + process_noise,
    )


def update(
    states: Gaussians, measured: Float64, observation: Float64, measurement_noise: Float64
) -> Gaussians:
    """Correct every state by its own measurement, in the form that keeps covariances symmetric (Joseph's)."""
    innovation = measured - states.mean @ observation.T
    seen = observation @ states.covariance @ observation.T + measurement_noise
    gain = np.linalg.solve(seen, observation @ states.covariance).transpose(0, 2, 1)
    kept = np.eye(states.mean.shape[1]) - gain @ observation
    return Gaussians(
        states.mean + np.einsum("tnk,tk->tn", gain, innovation),
        kept @ states.covariance @ kept.transpose(0, 2, 1)
        + gain @ measurement_noise @ gain.transpose(0, 2, 1),
    )


def mahalanobis_squared(
    states: Gaussians, measured: Float64, observation: Float64, measurement_noise: Float64
) -> Float64:
    """Return (T, D) how far each of (D, k) measurements is from what each filter expects.

    Where the filter is right this is chi-squared with k degrees of freedom.
    """
    away = measured[None] - (states.mean @ observation.T)[:, None]
    seen = observation @ states.covariance @ observation.T + measurement_noise
    weighted = np.linalg.solve(seen, away.transpose(0, 2, 1)).transpose(0, 2, 1)
    return np.asarray((away * weighted).sum(axis=2))
