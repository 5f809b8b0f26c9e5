"""Angles, which are the same a turn later."""

import numpy as np

from perception.types import Float64


def wrap(angle_rad: Float64 | float, period_rad: float = 2 * np.pi) -> Float64:
    """Return the same angle within half a period of 0."""
    return np.asarray((angle_rad + period_rad / 2) % period_rad - period_rad / 2)
