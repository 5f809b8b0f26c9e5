"""The least loss near a start, by steps of Broyden, Fletcher, Goldfarb and Shanno (Nocedal and Wright, 2006, chapter 6).

An optimizer of SciPy spends a third of its time between losses of 60 us, and it cannot be told how curved the loss usually is,
which saves a third of the steps.
"""

from collections.abc import Callable

import numpy as np

from perception.types import Float64

# Share of the decrease that the slope promises, from which a step is taken; the smallest share of a step that is tried.
_DECREASE, _MIN_SHARE = 1e-4, 1e-3
_MAX_STEPS = 60


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
