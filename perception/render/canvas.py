"""A picture being drawn: an (H, W, 3) array of RGB."""

import cv2
import numpy as np

from perception.render.palette import Color
from perception.types import Bool, Float64, Int, UInt8


def blank_canvas(size_px: tuple[int, int], color: Color) -> UInt8:
    """Return a canvas of (width, height) pixels in one colour."""
    width, height = size_px
    canvas = np.empty((height, width, 3), np.uint8)
    # Ten times as fast as assigning three numbers to every pixel.
    cv2.rectangle(canvas, (0, 0), (width, height), color, cv2.FILLED)
    return canvas


def is_inside(pixels: Float64 | Int, size_px: tuple[int, int], margin_px: float | Int = 0) -> Bool:
    """Tell which (N, 2) pixels round to one of the canvas, grown by a margin; NaN does not."""
    column, row = pixels[:, 0], pixels[:, 1]
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (column > -0.5 - margin_px)
            & (row > -0.5 - margin_px)
            & (column < size_px[0] - 0.5 + margin_px)
            & (row < size_px[1] - 0.5 + margin_px)
        )
