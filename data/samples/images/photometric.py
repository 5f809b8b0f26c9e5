"""Photometric augmentation of camera images: other cameras, light and weather, far beyond what is likely.

A detector that is trained on rendered streets must not rely on how they are rendered: Tobin et al., "Domain randomization for transferring deep neural networks from simulation to the real world", IROS 2017.
"""

from functools import cache

import cv2
import numpy as np

from data.samples.images.config import PhotometricConfig
from perception.detection.detectors.network_input import jpeg_compressed
from perception.types import Float32, UInt8

_LUMA = np.array([0.299, 0.587, 0.114])
_GREY_AXIS = np.ones(3) / np.sqrt(3)
_WORST_JPEG, _BEST_JPEG = 25, 90
_MIN_BLUR_PX = 0.3  # less changes nothing
_LIGHT_CELLS = (3, 6)  # rows and columns of the lattice of the brightness
_NOISE_LENGTH = 1 << 20


def transform_image(image: UInt8, magnitudes: PhotometricConfig, rng: np.random.Generator) -> UInt8:
    """Return an (h, w, 3) image as another camera would record it in other light."""
    transformed = _colored(image, magnitudes, rng)
    transformed = _lit(transformed, magnitudes, rng)
    transformed = _toned(transformed, magnitudes, rng)
    transformed = _filtered(transformed, magnitudes, rng)
    return _recorded(transformed, magnitudes, rng)


def _colored(image: UInt8, magnitudes: PhotometricConfig, rng: np.random.Generator) -> UInt8:
    """Rotate the hue and change the saturation."""
    turn, towards = rng.uniform(-1, 1, 2)
    rotation, _ = cv2.Rodrigues(magnitudes.hue_rad * turn * _GREY_AXIS)
    saturation = 1 + magnitudes.saturation * towards
    towards_grey = saturation * np.eye(3) + (1 - saturation) * np.tile(_LUMA, (3, 1))
    return np.asarray(cv2.transform(image, towards_grey @ rotation), np.uint8)


def _toned(image: UInt8, magnitudes: PhotometricConfig, rng: np.random.Generator) -> UInt8:
    """Change brightness, contrast, gamma and white balance by a table for each colour."""
    bright, contrast, gamma, *balance = rng.uniform(-1, 1, 6)
    of_colors = (1 + magnitudes.white_balance) ** np.array(balance)
    gains = (1 + magnitudes.brightness) ** bright * of_colors
    mean = np.mean(cv2.mean(image)[:3]) / 255
    values = mean + (np.arange(256)[:, None] / 255 - mean) * (1 + magnitudes.contrast) ** contrast
    powers = np.clip(values * gains, 0, 1) ** ((1 + magnitudes.gamma) ** gamma)
    return np.asarray(cv2.LUT(image, np.round(255 * powers).astype(np.uint8)[None]), np.uint8)


def _lit(image: UInt8, magnitudes: PhotometricConfig, rng: np.random.Generator) -> UInt8:
    """Vary the light over the image, and perhaps add a shadow with an edge."""
    height, width = image.shape[:2]
    lattice = (1 + magnitudes.light) ** rng.uniform(-1, 1, _LIGHT_CELLS)
    corners, depth, lot = rng.uniform(-0.2, 1.2, (4, 2)), rng.uniform(0.3, 0.75), rng.random()
    is_shadowed = lot < magnitudes.shadow
    if magnitudes.light == 0 and not is_shadowed:
        return image
    light = cv2.resize(lattice.astype(np.float32), (width, height))
    if is_shadowed:
        shade = np.ones((height, width), np.float32)
        hull = cv2.convexHull((corners * (width, height)).astype(np.int32))
        cv2.fillConvexPoly(shade, hull, 1 - depth)
        light = cv2.multiply(light, cv2.blur(shade, (5, 5)))
    return np.asarray(cv2.multiply(image, cv2.merge([light] * 3), dtype=cv2.CV_8U), np.uint8)


def _filtered(image: UInt8, magnitudes: PhotometricConfig, rng: np.random.Generator) -> UInt8:
    """Blur the image, or apply a random filter that leaves uniform areas unchanged."""
    kernel = magnitudes.filtering * rng.standard_normal((3, 3))
    kernel -= kernel.mean()
    kernel[1, 1] += 1
    blur_px, lot = magnitudes.blur_px * rng.random(), rng.random()
    if lot < 0.5 and magnitudes.filtering > 0:
        return np.asarray(cv2.filter2D(image, -1, kernel), np.uint8)
    if lot >= 0.5 and blur_px > _MIN_BLUR_PX:
        return np.asarray(cv2.GaussianBlur(image, (0, 0), blur_px), np.uint8)
    return image


def _recorded(image: UInt8, magnitudes: PhotometricConfig, rng: np.random.Generator) -> UInt8:
    """Add sensor noise, and perhaps JPEG artefacts."""
    noise = magnitudes.noise * rng.random()
    quality, lot = int(rng.integers(_WORST_JPEG, _BEST_JPEG)), rng.random()
    if noise > 0:
        grain = np.float32(noise) * normal_noise(image.shape, rng)
        image = np.asarray(cv2.add(image, grain, dtype=cv2.CV_8U), np.uint8)
    return jpeg_compressed(image, quality) if lot < magnitudes.jpeg else image


def normal_noise(shape: tuple[int, ...], rng: np.random.Generator) -> Float32:
    """Return standard normal numbers of a shape, the same for the same state of `rng`.

    They are read from a table at a random offset: drawing them takes as long as the rest of the augmentation.
    Two images may share some of them at other places.
    """
    count = int(np.prod(shape))
    numbers = _noise_table(-(-count // _NOISE_LENGTH) * _NOISE_LENGTH)
    first = int(rng.integers(_NOISE_LENGTH))
    return numbers[first : first + count].reshape(shape)


@cache
def _noise_table(length: int) -> Float32:
    numbers = np.random.default_rng(0).standard_normal(length + _NOISE_LENGTH, np.float32)
    numbers.flags.writeable = False
    return numbers
