"""Single pixels painted by the hundred thousand: a pixel's colour is written as one number."""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.render.canvas import is_inside
from perception.types import Float64, Int, UInt8

# Red, green, blue and a spare byte; ten times as fast to write as three bytes.
PackedColors = NDArray[np.uint32]


def packed(colors: UInt8) -> PackedColors:
    """Return (N,) numbers of (N, 3) colours."""
    spread = np.zeros((len(colors), 4), np.uint8)
    spread[:, :3] = colors
    return spread.view(np.uint32)[:, 0]


def unpacked(image: PackedColors) -> UInt8:
    """Return the (H, W, 3) picture of (H, W) packed colours."""
    four = image.view(np.uint8).reshape(*image.shape, 4)
    return np.asarray(cv2.cvtColor(four, cv2.COLOR_RGBA2RGB), np.uint8)


def paint_pixels(canvas: UInt8, places: Int, colors: PackedColors) -> None:
    """Paint (K,) pixels of an (H, W, 3) canvas; of what is painted onto the same one, the last stays.

    Args:
        canvas: what is painted on.
        places: row * width + column of each.
        colors: (K,) of `packed`, or one for all.
    """
    four = cv2.cvtColor(canvas, cv2.COLOR_RGB2RGBA)
    four.view(np.uint32).reshape(-1)[places] = colors
    canvas[:] = cv2.cvtColor(four, cv2.COLOR_RGBA2RGB)


def places_of(pixels: Float64, size_px: tuple[int, int], width_px: int) -> tuple[Int, Int]:
    """Return which of (N, 2) pixels, rounded, lie within (width, height), and their places.

    Args:
        pixels: columns and rows; NaN is nowhere.
        size_px: where they count as within.
        width_px: of the canvas, for row * width + column.
    """
    shown = np.flatnonzero(is_inside(pixels, size_px))
    column, row = (np.rint(pixels[:, axis].take(shown)).astype(np.int64) for axis in (0, 1))
    return shown, row * width_px + column
