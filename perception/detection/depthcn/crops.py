"""Crops of an image, resized to the network's input.

An affine map takes each point of the crop to a point of the image, so that cropping and, in training, changes of
scale, position and orientation are one warp of the full image.

    crop (u, v) --window_map--> image (x, y)          whole numbers are the centres of pixels

The default takes the nearest pixel: a depth interpolated between a car and its background, or an unknown pixel, would
be wrong. The thesis' crops are resized as images are, by cubic interpolation (the author's code).
"""

from collections.abc import Mapping
from typing import Literal

import cv2
import numpy as np

from perception.errors import PerceptionError
from perception.kernels.crops import crop_nearest
from perception.types import Float, Float64, Method, UInt8

CROP_HEIGHT_PX, CROP_WIDTH_PX = 66, 112  # the network's input (6.1.3)
WindowKind = Literal["box", "metric"]

_WIDTH_M = 7.0  # a car from the side, with a margin
_MARGIN = 0.15  # below the box, share of the window's height
# Minimum width of a window: a cluster of one column of points has no width.
MIN_EDGE_PX = 1.0
_INTERPOLATIONS: Mapping[Method, int] = {"default": cv2.INTER_NEAREST, "thesis": cv2.INTER_CUBIC}


def windows_px(kind: WindowKind, boxes_px: Float64, depths_m: Float, focal_px: float) -> Float64:
    """Return the (M, 4) windows x1 y1 x2 y2, which may extend beyond the image.

    Args:
        kind: Kind of window: `box` is the proposal (thesis), `metric` has a fixed size in metres.
        boxes_px: (M, 4) boxes x1 y1 x2 y2 of the proposals.
        depths_m: (M,) depths of the proposals in metres.
        focal_px: Focal length of the camera in pixels.
    """
    if kind == "box":
        return boxes_px.astype(np.float64)
    width = _WIDTH_M * focal_px / np.maximum(depths_m, 1.0)
    height = width * CROP_HEIGHT_PX / CROP_WIDTH_PX
    center, bottom = (boxes_px[:, 0] + boxes_px[:, 2]) / 2, boxes_px[:, 3] + _MARGIN * height
    return np.stack([center - width / 2, bottom - height, center + width / 2, bottom], axis=1)


def crop_windows(image: UInt8, windows_px: Float, method: Method = "default") -> UInt8:
    """Return the (M, C, 66, 112) crops of windows of an image; 0 beyond its edges.

    Args:
        image: (H, W, C) image.
        windows_px: (M, 4) x1 y1 x2 y2 of the windows.
        method: Method of the interpolation.

    Raises:
        PerceptionError: a window is not finite.
    """
    shape = (len(windows_px), image.shape[2], CROP_HEIGHT_PX, CROP_WIDTH_PX)
    crops: UInt8 = np.empty(shape, np.uint8)
    image_A_crops = window_maps(windows_px)
    if method == "default":
        crop_nearest(np.ascontiguousarray(image.transpose(2, 0, 1)), image_A_crops, crops)
        return crops
    for crop, image_A_crop in zip(crops, image_A_crops, strict=True):
        crop[:] = warp(image, image_A_crop, method).transpose(2, 0, 1)
    return crops


def window_maps(windows_px: Float) -> Float64:
    """Return the (M, 3, 3) affine maps from the crop of each (M, 4) window to the image.

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
    # The centre of pixel 0 of the crop lies half a pixel inside the window.
    maps[:, :2, 2] = corner + scale / 2
    return maps


def warp(image: UInt8, image_A_crop: Float64, method: Method = "default") -> UInt8:
    """Return the (66, 112, C) crop of an (H, W, C) image by a (3, 3) affine map."""
    crop = cv2.warpAffine(
        image,
        image_A_crop[:2],
        (CROP_WIDTH_PX, CROP_HEIGHT_PX),
        flags=_INTERPOLATIONS[method] | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
    )
    return np.asarray(crop.reshape(CROP_HEIGHT_PX, CROP_WIDTH_PX, image.shape[2]), np.uint8)
