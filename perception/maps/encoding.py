"""Maps as 8-bit images: near depths get more of the 256 values than far ones (6.2)."""

import cv2
import numpy as np

from perception.types import Float32, UInt8

# Depths that become 0 and 255.
_NEAREST_M, _FARTHEST_M = 5.0, 80.0
_SCALE = 255 * _FARTHEST_M / (_FARTHEST_M - _NEAREST_M)


def encode_depth(depth_m: Float32) -> UInt8:
    """Return depths as 0 at 5 m and 255 at 80 m, linear in inverse depth (6.2).

    Rounded, not floored as printed: half the error. Depths outside the limits take the value of
    the limit, unknown depths (0) that of the nearest; the validity mask separates them.
    """
    inverse = np.clip(depth_m, np.float32(_NEAREST_M), np.float32(_FARTHEST_M))
    np.reciprocal(inverse, out=inverse)
    return _scaled_to_8_bits(inverse, -_SCALE * _NEAREST_M, _SCALE)


def encode_reflectance(reflectance: Float32) -> UInt8:
    """Return reflectances 0..1 as 0..255."""
    return _scaled_to_8_bits(reflectance, 255.0)


def _scaled_to_8_bits(values: Float32, factor: float, offset: float = 0.0) -> UInt8:
    """Scale, round and saturate in one call; no scaled value is below -0.5."""
    if values.size == 0:  # OpenCV returns nothing for nothing
        return np.zeros(values.shape, np.uint8)
    scaled = np.asarray(cv2.convertScaleAbs(values, alpha=factor, beta=offset), np.uint8)
    return scaled.reshape(values.shape)  # OpenCV 4 makes a column of a line


def decode_depth(encoded: UInt8) -> Float32:
    """Return the depths of the 8-bit values of `encode_depth`, to within its rounding."""
    return np.asarray(_SCALE * _NEAREST_M / (_SCALE - encoded.astype(np.float32)), np.float32)
