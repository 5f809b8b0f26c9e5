"""Windows of a picture, cut out and brought to the size of the network's input.

A point of the crop is a point of the picture by an affine map, so that cutting out, and in training every
change of scale, place and direction too, is one warp straight from the full picture.

    crop (u, v) --window_map--> picture (x, y)          whole numbers are the centres of pixels
"""

import cv2
import numpy as np

from perception.detection.depthcn.windows import CROP_HEIGHT_PX, CROP_WIDTH_PX
from perception.errors import PerceptionError
from perception.types import Float, Float64, UInt8

# A window narrower than this is taken as this wide: a cluster of one column of points has no width.
MIN_EDGE_PX = 1.0


def crop_windows(image: UInt8, windows_px: Float) -> UInt8:
    """Return (M, C, 66, 112) of an (H, W, C) picture; what lies beyond its edges is 0.

    Raises:
        PerceptionError: a window is not finite.
    """
    channels = image.shape[2]
    crops = np.empty((len(windows_px), channels, CROP_HEIGHT_PX, CROP_WIDTH_PX), np.uint8)
    # OpenCV warps four channels in half the time of three.
    if channels == 3:
        image = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2RGBA), np.uint8)
    for crop, image_A_crop in zip(crops, window_maps(windows_px), strict=True):
        crop[:] = warp(image, image_A_crop)[..., :channels].transpose(2, 0, 1)
    return crops


def window_maps(windows_px: Float) -> Float64:
    """Return (M, 3, 3) which point of the picture lies at a point of the crop of each (M, 4) window.

    Raises:
        PerceptionError: a window is not finite.
    """
    if not np.isfinite(windows_px).all():
        raise PerceptionError("windows_px", expected="finite windows", found="NaN or infinity")
    corner = np.asarray(windows_px[:, :2], np.float64)
    size = np.maximum(windows_px[:, 2:] - corner, MIN_EDGE_PX)
    scale = size / (CROP_WIDTH_PX, CROP_HEIGHT_PX)
    maps = np.zeros((len(windows_px), 3, 3))
    maps[:, 0, 0], maps[:, 1, 1], maps[:, 2, 2] = scale[:, 0], scale[:, 1], 1.0
    # Pixel 0 of the crop covers the window's first share of its width: its centre lies half a pixel in.
    maps[:, :2, 2] = corner + scale / 2
    return maps


def warp(image: UInt8, image_A_crop: Float64) -> UInt8:
    """Return the (66, 112, C) crop that a (3, 3) map takes from an (H, W, C) picture.

    Each pixel is the nearest one of the picture: between a car and what lies behind it, or what is not
    known, no depth in between is true.
    """
    crop = cv2.warpAffine(
        image,
        image_A_crop[:2],
        (CROP_WIDTH_PX, CROP_HEIGHT_PX),
        flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
    )
    return np.asarray(crop.reshape(CROP_HEIGHT_PX, CROP_WIDTH_PX, image.shape[2]), np.uint8)
