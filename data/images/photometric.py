"""What other cameras, light and weather make of an image, far beyond what is likely.

A detector that learns from drawn streets and is used on real ones must not rely on how things are drawn: Tobin
et al., "Domain randomization for transferring deep neural networks from simulation to the real world", IROS 2017.
"""

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np

from data.images.input_images import jpeg_compressed
from data.images.noise_table import normal_noise
from data.magnitudes import AugmentationConfig
from perception.types import UInt8

_LUMA = np.array([0.299, 0.587, 0.114])
_GREY_AXIS = np.ones(3) / np.sqrt(3)
_WORST_JPEG, _BEST_JPEG = 25, 90
_MIN_BLUR_PX = 0.3  # less changes nothing
_LIGHT_CELLS = (3, 6)  # rows and columns of the lattice by which brightness changes over an image


@dataclass(frozen=True)
class PhotometricConfig(AugmentationConfig):
    """How much images change.

    Attributes:
        brightness: values are multiplied or divided by up to 1 + this.
        contrast: likewise their distances from the mean.
        gamma: likewise their power.
        white_balance: likewise each colour by itself.
        saturation: colours are up to this share weaker or stronger.
        hue_rad: colours turn by up to this.
        light: brightness varies over the image by up to a factor of 1 + this, smoothly.
        shadow: probability of an edged shadow, up to 75 % dark.
        filtering: standard deviation of the weights of a random 3x3 filter beside the pixel's own: Xu et al.,
            "Robust and generalizable visual representation learning via random convolutions", ICLR 2021.
        blur_px: standard deviation of a blur, at most.
        noise: standard deviation of each value of 0..255, at most.
        jpeg: probability of JPEG's traces.
    """

    MAX: ClassVar = {
        "saturation": 1.0,
        "shadow": 1.0,
        "filtering": 0.5,
        "noise": 100.0,
        "jpeg": 1.0,
    }

    brightness: float = 0.5
    contrast: float = 0.5
    gamma: float = 0.4
    white_balance: float = 0.15
    saturation: float = 0.8
    hue_rad: float = 0.35
    light: float = 0.4
    shadow: float = 0.3
    filtering: float = 0.06
    blur_px: float = 1.0
    noise: float = 10.0
    jpeg: float = 0.25


def transform_image(image: UInt8, magnitudes: PhotometricConfig, rng: np.random.Generator) -> UInt8:
    """Return an (h, w, 3) image as another camera would take it, in another light."""
    transformed = _colored(image, magnitudes, rng)
    transformed = _lit(transformed, magnitudes, rng)
    transformed = _toned(transformed, magnitudes, rng)
    transformed = _filtered(transformed, magnitudes, rng)
    return _recorded(transformed, magnitudes, rng)


def _colored(image: UInt8, magnitudes: PhotometricConfig, rng: np.random.Generator) -> UInt8:
    """Turn colours about the grey axis, and move them towards or away from grey."""
    turn, towards = rng.uniform(-1, 1, 2)
    rotation, _ = cv2.Rodrigues(magnitudes.hue_rad * turn * _GREY_AXIS)
    saturation = 1 + magnitudes.saturation * towards
    towards_grey = saturation * np.eye(3) + (1 - saturation) * np.tile(_LUMA, (3, 1))
    return np.asarray(cv2.transform(image, towards_grey @ rotation), np.uint8)


def _toned(image: UInt8, magnitudes: PhotometricConfig, rng: np.random.Generator) -> UInt8:
    """Change each value of each colour by a table."""
    bright, contrast, gamma, *balance = rng.uniform(-1, 1, 6)
    of_colors = (1 + magnitudes.white_balance) ** np.array(balance)
    gains = (1 + magnitudes.brightness) ** bright * of_colors
    mean = np.mean(cv2.mean(image)[:3]) / 255
    values = mean + (np.arange(256)[:, None] / 255 - mean) * (1 + magnitudes.contrast) ** contrast
    powers = np.clip(values * gains, 0, 1) ** ((1 + magnitudes.gamma) ** gamma)
    return np.asarray(cv2.LUT(image, np.round(255 * powers).astype(np.uint8)[None]), np.uint8)


def _lit(image: UInt8, magnitudes: PhotometricConfig, rng: np.random.Generator) -> UInt8:
    """Return an image with light that varies over it, and perhaps a shadow's edge."""
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
    """Return an image blurred, or drawn by a random filter that leaves an even area as it is."""
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
    """Add a sensor's noise, and perhaps the traces of JPEG."""
    noise = magnitudes.noise * rng.random()
    quality, lot = int(rng.integers(_WORST_JPEG, _BEST_JPEG)), rng.random()
    if noise > 0:
        grain = np.float32(noise) * normal_noise(image.shape, rng)
        image = np.asarray(cv2.add(image, grain, dtype=cv2.CV_8U), np.uint8)
    return jpeg_compressed(image, quality) if lot < magnitudes.jpeg else image
