"""Augmentation of depth and reflectance maps: other LiDARs and worse conditions; 0, unknown, stays unknown.

dropout, beam_dropout   returns and whole beams that are missing
fading                  far (depth map) or weak (reflectance map) returns that are missing
range_noise_m           depth map: range noise
gain, gamma             reflectance map: LiDARs of other reflectance scales
speckle                 reflectance map: noise
"""

import cv2
import numpy as np

from data.samples.images.config import MapAugmentationConfig
from data.samples.images.photometric import normal_noise
from perception.maps.encoding import decode_depth, encode_depth
from perception.types import Float32, Float64, UInt8

_ALL = np.arange(256, dtype=np.uint8)
_DEPTHS_M: Float32 = decode_depth(_ALL)
# Relative probability, 0..1, that a return is lost, by its pixel's value: 1 at 80 m, or without reflectance.
_FAR = (_ALL / 255.0) ** 4
_WEAK = 1 - np.sqrt(_ALL / 255.0)
_CELLS_PX = (2, 3, 5, 8, 13)  # edges of the cells that are lost together
_NOISE_CELL_PX = 2  # filled maps repeat a return's value around it


def transform_depth_map(
    image: UInt8,
    zoom: float,
    magnitudes: MapAugmentationConfig,
    rng: np.random.Generator,
    *,
    is_filled: bool = True,
) -> UInt8:
    """Return an (h, w, 1) depth map with depths divided by a zoom, errors, and losses."""
    noise_m = np.float32(magnitudes.range_noise_m * rng.random() ** 2)
    transformed = image[..., 0]
    if zoom != 1 or noise_m > 0:
        depth_m = np.take(_DEPTHS_M / np.float32(zoom), transformed)
        if noise_m > 0:
            depth_m += noise_m * _cells_noise(transformed.shape, rng)
        encoded = encode_depth(depth_m)
        transformed = np.asarray(cv2.copyTo(encoded, transformed))  # where it is not 0
    transformed = _drop_beams(transformed, magnitudes, rng, is_filled)
    return _drop_cells(transformed, _FAR, magnitudes, rng)[..., None]


def transform_reflectance_map(
    image: UInt8,
    magnitudes: MapAugmentationConfig,
    rng: np.random.Generator,
    *,
    is_filled: bool = True,
) -> UInt8:
    """Return an (h, w, 1) reflectance map with other reflectances, errors, and losses."""
    gain, gamma = rng.uniform(-1, 1, 2)
    speckle = np.float32(magnitudes.speckle * rng.random() ** 2)
    power = (1 + magnitudes.gamma) ** gamma
    table = (1 + magnitudes.gain) ** gain * 255 * (_ALL / 255.0) ** power
    reflectance = np.take(table.astype(np.float32), image[..., 0])
    if speckle > 0:
        reflectance *= 1 + speckle * _cells_noise(reflectance.shape, rng)
    transformed = np.asarray(cv2.convertScaleAbs(np.maximum(reflectance, 0)), np.uint8)
    transformed = _drop_beams(transformed, magnitudes, rng, is_filled)
    return _drop_cells(transformed, _WEAK, magnitudes, rng)[..., None]


def _drop_beams(
    image: UInt8, magnitudes: MapAugmentationConfig, rng: np.random.Generator, is_filled: bool
) -> UInt8:
    """Return an (h, w) map without some rows, or with the rows above in their place."""
    share = magnitudes.beam_dropout * rng.random() ** 2
    is_lost = rng.random(len(image)) < share
    if not is_filled:
        return np.asarray(np.where(is_lost[:, None], np.uint8(0), image))
    rows = np.where(is_lost, 0, np.arange(len(image)))
    return image[np.maximum.accumulate(rows)]


def _drop_cells(
    image: UInt8, weights: Float64, magnitudes: MapAugmentationConfig, rng: np.random.Generator
) -> UInt8:
    """Return an (h, w) map with cells set to 0.

    Args:
        image: (h, w) map.
        weights: (256,) relative probability of a loss by pixel value.
        magnitudes: Largest fractions that are lost.
        rng: Random generator.
    """
    dropout, fading = rng.random(2) ** 2 * (magnitudes.dropout, magnitudes.fading)
    height, width = image.shape
    cell = int(rng.choice(_CELLS_PX))
    lots = rng.integers(0, 255, (-(-height // cell), -(-width // cell)), np.uint8)
    cells = cv2.resize(lots, (width, height), interpolation=cv2.INTER_NEAREST)
    losing = np.round(255 * (1 - (1 - dropout) * (1 - fading * weights))).astype(np.uint8)
    is_kept = cv2.compare(cells, cv2.LUT(image, losing), cv2.CMP_GE)
    return np.asarray(cv2.bitwise_and(image, is_kept), np.uint8)


def _cells_noise(shape: tuple[int, ...], rng: np.random.Generator) -> Float32:
    """Return (h, w) normal numbers, equal over small cells."""
    small = (-(-shape[0] // _NOISE_CELL_PX), -(-shape[1] // _NOISE_CELL_PX))
    noise = cv2.resize(normal_noise(small, rng), shape[::-1], interpolation=cv2.INTER_NEAREST)
    return np.asarray(noise, np.float32)
