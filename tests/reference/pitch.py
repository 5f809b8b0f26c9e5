"""The density of ground angles as (5.10) writes it: a Gaussian for every point, at every angle asked for."""

import numpy as np

from perception.types import Float, Float64


def reference_density(angles_rad: Float, at_rad: Float64, width_rad: float) -> Float64:
    """Return (A,) the density of (N,) angles at each of (A,) angles (5.10)."""
    away = (at_rad[:, None] - np.asarray(angles_rad, np.float64)) / width_rad
    kernels = np.exp(-(away**2) / 2) / (np.sqrt(2 * np.pi) * width_rad)
    return np.asarray(kernels.mean(axis=1))


def reference_mode_rad(angles_rad: Float, at_rad: Float64, width_rad: float) -> float:
    """Return the angle with the highest density among those asked for."""
    return float(at_rad[reference_density(angles_rad, at_rad, width_rad).argmax()])
