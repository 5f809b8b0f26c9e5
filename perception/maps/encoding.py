"""Maps as 8-bit images: near depths get more of the 256 values than far ones (6.2)."""

import cv2
import numpy as np

from perception.errors import UsageError
from perception.types import Float32, UInt8


def encode_depth(depth_m: Float32, min_depth_m: float = 5.0, max_depth_m: float = 80.0) -> UInt8:
    """Return depths as 0 at the nearest and 255 at the farthest, linear in inverse depth (6.2).

    Rounded, not floored as printed: half the error. Depths outside the limits take the value of
    the limit, unknown depths (0) that of the nearest; the validity mask separates them.
    """
    if not 0 < min_depth_m < max_depth_m:
        raise UsageError(
            "range of the depth map",
            expected="0 < nearest < farthest",
            found=f"{min_depth_m:g} and {max_depth_m:g} m",
        )
    scale = 255 * max_depth_m / (max_depth_m - min_depth_m)
    inverse = np.clip(depth_m, np.float32(min_depth_m), np.float32(max_depth_m))
    np.reciprocal(inverse, out=inverse)
    return _scaled_to_8_bits(inverse, -scale * min_depth_m, scale)


def encode_reflectance(reflectance: Float32) -> UInt8:
    """Return reflectances 0..1 as 0..255."""
    return _scaled_to_8_bits(reflectance, 255.0)


def _scaled_to_8_bits(values: Float32, factor: float, offset: float = 0.0) -> UInt8:
    """Scale, round and saturate in one call; no scaled value is below -0.5."""
    if values.size == 0:  # OpenCV returns nothing for nothing
        return np.zeros(values.shape, np.uint8)
    scaled = np.asarray(cv2.convertScaleAbs(values, alpha=factor, beta=offset), np.uint8)
    return scaled.reshape(values.shape)  # OpenCV 4 makes a column of a line


def decode_depth(encoded: UInt8, min_depth_m: float = 5.0, max_depth_m: float = 80.0) -> Float32:
    """Return the depths of the 8-bit values of `encode_depth`, to within its rounding."""
    scale = 255 * max_depth_m / (max_depth_m - min_depth_m)
    return np.asarray(scale * min_depth_m / (scale - encoded.astype(np.float32)), np.float32)
