"""Batched Kalman filters: T filters of n states each, every step one computation.

The functions are pure: states go in, new ones come out. Time step, noise and measurement are arguments, so that one
file serves every motion model.

    mean (T, n)   covariance (T, n, n)   transition (n, n)   process noise (n, n) or (T, n, n)
    measured (T, k)   observation (k, n)   measurement noise (k, k) or (T, k, k)
"""

from dataclasses import dataclass, replace
from typing import Annotated, TypeVar

import numpy as np

from perception.types import ArrayTable, Float64


@dataclass(frozen=True)
class Gaussians(ArrayTable):
    """States of T filters.

    Attributes:
        mean: (T, n) means.
        covariance: (T, n, n) covariances.
    """

    mean: Annotated[Float64, ...]
    covariance: Annotated[Float64, ...]


States = TypeVar("States", bound=Gaussians)  # states, or tracks that have a state each


def predict(states: States, transition: Float64, process_noise: Float64) -> States:
    """Predict every state by one step."""
    return replace(
        states,
        mean=states.mean @ transition.T,
        covariance=transition @ states.covariance @ transition.T + process_noise,
    )


def update(
    states: States, measured: Float64, observation: Float64, measurement_noise: Float64
) -> States:
    """Correct every state by its own measurement, in the form that keeps covariances symmetric (Joseph's)."""
    innovation = measured - states.mean @ observation.T
    spread = observation @ states.covariance @ observation.T + measurement_noise
    gain = np.linalg.solve(spread, observation @ states.covariance).transpose(0, 2, 1)
    kept = np.eye(states.mean.shape[1]) - gain @ observation
    return replace(
        states,
        mean=states.mean + np.einsum("tnk,tk->tn", gain, innovation),
        covariance=kept @ states.covariance @ kept.transpose(0, 2, 1)
        + gain @ measurement_noise @ gain.transpose(0, 2, 1),
    )


def mahalanobis_squared(
    states: Gaussians, measured: Float64, observation: Float64, measurement_noise: Float64
) -> Float64:
    """Return (T, D) the squared distances of measurements from the prediction of each filter.

    For a correct filter they are chi-squared with two degrees of freedom.

    Args:
        states: T filters.
        measured: (D, 2) measurements, or (T, D, 2) where each filter has its own.
        observation: (2, n) observation.
        measurement_noise: (2, 2) noise, or (T, D, 2, 2).
    """
    away = measured - (states.mean @ observation.T)[:, None]
    spread = (observation @ states.covariance @ observation.T)[:, None] + measurement_noise
    # In closed form, as there are many pairs.
    x, y = away[..., 0], away[..., 1]
    xx, xy, yy = spread[..., 0, 0], spread[..., 0, 1], spread[..., 1, 1]
    return np.asarray((yy * x**2 - 2 * xy * x * y + xx * y**2) / (xx * yy - xy**2))
