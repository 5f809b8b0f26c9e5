"""Noise to look up by place: white, of many scales, and smooth.

Places are often columns of other arrays: they are copied, since compiled functions take contiguous arrays.
"""

import numpy as np

from perception.kernels.rendering import look_up, look_up_between
from perception.types import Float, Float32

_SIZE = 512


def _fractal_noise(seed: int) -> Float32:
    """Return a noise image that tiles, of many scales, with mean 0 and deviation 1."""
    waves = np.fft.fftfreq(_SIZE) * _SIZE
    radius = np.maximum(np.hypot(waves[:, None], waves[None]), 1.0)
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, radius.shape)
    image = np.fft.ifft2(np.exp(1j * phases) / radius**1.1).real
    # Releases of NumPy differ about the order of the axes in memory.
    return np.ascontiguousarray((image - image.mean()) / image.std(), np.float32)


_NOISE = _fractal_noise(5)
_GRAIN = np.random.default_rng(6).normal(0, 1, (_SIZE, _SIZE)).astype(np.float32)


def smooth_noise(x: Float, y: Float) -> Float32:
    """Look up noise of many scales; it repeats after 512 units."""
    values = np.empty(len(x), np.float32)
    look_up(values, _NOISE, x.copy(), y.copy())
    return values


def grain(x: Float, y: Float) -> Float32:
    """Look up white noise, constant within a unit square."""
    values = np.empty(len(x), np.float32)
    look_up(values, _GRAIN, x.copy(), y.copy())
    return values


def clouds(x: Float, y: Float) -> Float32:
    """Look up noise of many scales, interpolated between its samples."""
    values = np.empty(len(x), np.float32)
    look_up_between(values, _NOISE, x.copy(), y.copy())
    return values
