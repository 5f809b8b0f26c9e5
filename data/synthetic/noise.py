"""Noise to look up by place: white, of many scales, and smooth."""

import numpy as np

from perception.types import Float, Float32

_SIZE = 512


def _fractal_noise(seed: int) -> Float32:
    """Return a noise image that tiles, of many scales, with mean 0 and deviation 1."""
    waves = np.fft.fftfreq(_SIZE) * _SIZE
    radius = np.maximum(np.hypot(waves[:, None], waves[None]), 1.0)
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, radius.shape)
    image = np.fft.ifft2(np.exp(1j * phases) / radius**1.1).real
    return np.asarray((image - image.mean()) / image.std(), np.float32)


_NOISE = _fractal_noise(5)
_GRAIN = np.random.default_rng(6).normal(0, 1, (_SIZE, _SIZE)).astype(np.float32)


def smooth_noise(x: Float, y: Float) -> Float32:
    """Look up noise of many scales; it repeats after 512 units."""
    return _look_up(_NOISE, x, y)


def grain(x: Float, y: Float) -> Float32:
    """Look up white noise, constant within a unit square."""
    return _look_up(_GRAIN, x, y)


def _look_up(image: Float32, x: Float, y: Float) -> Float32:
    column = np.floor(x).astype(np.int32) & (_SIZE - 1)
    row = np.floor(y).astype(np.int32) & (_SIZE - 1)
    return np.take(image.ravel(), row * _SIZE + column)


def clouds(x: Float, y: Float) -> Float32:
    """Look up noise of many scales, interpolated between its samples."""
    left, low = np.floor(x), np.floor(y)
    u, v = x - left, y - low
    below = _look_up(_NOISE, left, low) * (1 - u) + _look_up(_NOISE, left + 1, low) * u
    above = _look_up(_NOISE, left, low + 1) * (1 - u) + _look_up(_NOISE, left + 1, low + 1) * u
    return np.asarray(below * (1 - v) + above * v, np.float32)
