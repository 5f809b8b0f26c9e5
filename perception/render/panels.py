"""The parts of which larger pictures are put together: titled panels, legends, and images at another size."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.render.canvas import blank_canvas, draw_text, text_width_px
from perception.render.palette import PANEL, Color
from perception.types import Float64, UInt8

# What stands in a legend: a word and its colours, of which each thing has one.
LegendEntry = tuple[str, tuple[Color, ...]]


def place_panel(canvas: UInt8, panel: UInt8, corner_px: tuple[int, int], title: str) -> None:
    """Put a panel, with its title in its upper left corner, into the canvas; nothing of an empty one."""
    if not len(panel):
        return
    column, row = corner_px
    height, width = panel.shape[:2]
    target = canvas[row : row + height, column : column + width]
    target[:] = panel
    text_px = _title_text_px(canvas)
    margin = text_px
    tag = target[: title_height_px(canvas), : text_width_px(title, text_px) + 2 * margin]
    tag[:] = tag // 3
    draw_text(target, title, (margin, 1.5 * text_px + 2), height_px=text_px)


def title_height_px(canvas: UInt8) -> int:
    """Return how high the titles of panels on a canvas are."""
    return 2 * _title_text_px(canvas) + 4


def _title_text_px(canvas: UInt8) -> int:
    return int(max(round(canvas.shape[0] / 80), 7))


def draw_legend(canvas: UInt8, legend: Sequence[LegendEntry], text_px: int) -> int:
    """Draw swatches with their words in a row at half height, from the left; return where it ends."""
    column, baseline, swatch_px = 1.2 * text_px, 0.5 * (canvas.shape[0] + text_px), 1.5 * text_px
    for name, colors in legend:
        top = round(baseline - 1.25 * text_px)
        edges = np.rint(np.linspace(column, column + swatch_px, len(colors) + 1)).astype(int)
        for color, left, right in zip(colors, edges[:-1], edges[1:], strict=True):
            canvas[top : round(top + swatch_px) + 1, left : right + 1] = color
        column += swatch_px + 0.7 * text_px
        draw_text(canvas, name, (column, baseline), height_px=text_px)
        column += text_width_px(name, text_px) + 1.8 * text_px
    return round(column)


@dataclass(frozen=True)
class Resizing:
    """Where the pixels of an image come to lie in a picture of a part of it; centres are whole numbers.

    Attributes:
        canvas_T_image: (3, 3) homogeneous, without turn.
    """

    canvas_T_image: Float64

    @classmethod
    def of_window(cls, window_px: Float64, size_px: tuple[int, int]) -> Self:
        """Let a (4,) window x1 y1 x2 y2 of an image fill a picture of (width, height)."""
        corner, opposite = window_px[:2], window_px[2:]
        scale = np.array(size_px) / (opposite - corner)
        transform = np.diag([*scale, 1.0])
        transform[:2, 2] = scale * (0.5 - corner) - 0.5
        return cls(transform)

    def project(self, image_P_velo: Float64) -> Float64:
        """Return the (3, 4) projection to the picture."""
        return np.asarray(self.canvas_T_image @ image_P_velo)

    def move(self, pixels: Float64) -> Float64:
        """Return (N, 2) where pixels of the image lie in the picture."""
        transform = self.canvas_T_image
        return np.asarray(pixels * transform.diagonal()[:2] + transform[:2, 2])

    def move_boxes(self, boxes_px: Float64) -> Float64:
        """Return (M, 4) where boxes x1 y1 x2 y2 of the image lie in the picture."""
        return self.move(boxes_px.reshape(-1, 2)).reshape(-1, 4)

    def cut(self, image: UInt8, size_px: tuple[int, int]) -> UInt8:
        """Return the enlarged (height, width, 3) part; what lies beyond the image is blank."""
        return np.asarray(
            cv2.warpAffine(
                image,
                self.canvas_T_image[:2],
                size_px,
                flags=cv2.INTER_CUBIC,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=PANEL,
            ),
            np.uint8,
        )


@dataclass(frozen=True)
class FittedImage:
    """An image at the largest size that fits somewhere.

    Attributes:
        canvas: (h, w, 3).
        resizing: from the image to it.
    """

    canvas: UInt8
    resizing: Resizing

    @classmethod
    def within(cls, image: UInt8, largest_px: tuple[int, int]) -> Self:
        """Resize an image to fit within (width, height)."""
        scale = min(largest_px[0] / image.shape[1], largest_px[1] / image.shape[0])
        width, height = round(image.shape[1] * scale), round(image.shape[0] * scale)
        # Down to half the size, a pixel's neighbours are all that it takes.
        interpolation = cv2.INTER_AREA if scale <= 0.5 else cv2.INTER_LINEAR
        canvas = cv2.resize(image, (width, height), interpolation=interpolation)
        whole = np.array([0, 0, image.shape[1], image.shape[0]], np.float64)
        resizing = Resizing.of_window(whole, (width, height))
        return cls(np.asarray(canvas, np.uint8), resizing)

    def on_strip(self, width_px: int) -> UInt8:
        """Return the picture centred on a strip that wide."""
        height, width = self.canvas.shape[:2]
        strip = blank_canvas((width_px, height), PANEL)
        left = (width_px - width) // 2
        strip[:, left : left + width] = self.canvas
        return strip
