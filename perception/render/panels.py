"""Parts of composed images: titled panels, legends and resized images."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.render.canvas import blank_canvas, draw_text, text_width_px
from perception.render.palette import PANEL, Color
from perception.types import Float64, UInt8

# Text of a legend entry and its colours, several where objects of one kind differ in colour.
LegendEntry = tuple[str, tuple[Color, ...]]


def place_panel(canvas: UInt8, panel: UInt8, corner_px: tuple[int, int], title: str) -> None:
    """Place a panel with a title in its upper left corner; an empty panel is left out."""
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
    """Return the height of the panel titles on a canvas."""
    return 2 * _title_text_px(canvas) + 4


def _title_text_px(canvas: UInt8) -> int:
    return int(max(round(canvas.shape[0] / 80), 7))


def draw_legend(canvas: UInt8, legend: Sequence[LegendEntry], text_px: int) -> int:
    """Draw colour swatches with their text in a row from the left; return the column of the end."""
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
    """Scale and shift from an image to a canvas that shows a part of it; pixel centres are whole numbers.

    Attributes:
        canvas_T_image: (3, 3) homogeneous transform without rotation.
    """

    canvas_T_image: Float64

    @classmethod
    def of_window(cls, window_px: Float64, size_px: tuple[int, int]) -> Self:
        """Return the resizing of a (4,) window x1 y1 x2 y2 of an image to (width, height)."""
        corner, opposite = window_px[:2], window_px[2:]
        scale = np.array(size_px) / (opposite - corner)
        transform = np.diag([*scale, 1.0])
        transform[:2, 2] = scale * (0.5 - corner) - 0.5
        return cls(transform)

    def project(self, image_P_velo: Float64) -> Float64:
        """Return the (3, 4) projection to the canvas."""
        return np.asarray(self.canvas_T_image @ image_P_velo)

    def move(self, pixels: Float64) -> Float64:
        """Return (N, 2) pixels of the image in the canvas."""
        transform = self.canvas_T_image
        return np.asarray(pixels * transform.diagonal()[:2] + transform[:2, 2])

    def move_boxes(self, boxes_px: Float64) -> Float64:
        """Return (M, 4) boxes x1 y1 x2 y2 of the image in the canvas."""
        return self.move(boxes_px.reshape(-1, 2)).reshape(-1, 4)

    def cut(self, image: UInt8, size_px: tuple[int, int]) -> UInt8:
        """Return the resized (height, width, 3) window; blank beyond the image."""
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
    """An image at the largest size that fits a panel.

    Attributes:
        canvas: (h, w, 3) resized image.
        resizing: Scale and shift from the image to the canvas.
    """

    canvas: UInt8
    resizing: Resizing

    @classmethod
    def within(cls, image: UInt8, largest_px: tuple[int, int]) -> Self:
        """Resize an image to fit within (width, height)."""
        scale = min(largest_px[0] / image.shape[1], largest_px[1] / image.shape[0])
        width, height = round(image.shape[1] * scale), round(image.shape[0] * scale)
        # Above half the size, bilinear interpolation uses all pixels.
        interpolation = cv2.INTER_AREA if scale <= 0.5 else cv2.INTER_LINEAR
        canvas = cv2.resize(image, (width, height), interpolation=interpolation)
        whole = np.array([0, 0, image.shape[1], image.shape[0]], np.float64)
        resizing = Resizing.of_window(whole, (width, height))
        return cls(np.asarray(canvas, np.uint8), resizing)

    def on_strip(self, width_px: int) -> UInt8:
        """Return the canvas centred on a strip of a width."""
        height, width = self.canvas.shape[:2]
        strip = blank_canvas((width_px, height), PANEL)
        left = (width_px - width) // 2
        strip[:, left : left + width] = self.canvas
        return strip
