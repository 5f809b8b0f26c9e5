"""Parts of composed images: titled panels, legends and resized images."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.render.canvas import blank_canvas, draw_text, fill_canvas, text_width_px
from perception.render.palette import PANEL, Color, LinePattern
from perception.render.strokes import Strokes, draw_strokes
from perception.types import Float64, Int, UInt8

# Width of the left column as a share: without a camera, and its limits with one.
_COLUMN_SHARE = 0.62
_COLUMN_SHARES = (0.36, 0.70)

_TITLE_MARGIN = 1.0  # in heights of the text


@dataclass(frozen=True)
class PanelArea:
    """Area of a panel in an image, in pixels.

    Attributes:
        left: First column.
        top: First row.
        right: Column behind the last.
        bottom: Row behind the last.
    """

    left: int
    top: int
    right: int
    bottom: int

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.right - self.left, self.bottom - self.top

    def of(self, image: UInt8) -> UInt8:
        """Return the panel of an (H, W, 3) image, not a copy."""
        return image[self.top : self.bottom, self.left : self.right]


@dataclass(frozen=True)
class LegendEntry:
    """A sample and what it stands for.

    Attributes:
        name: Text.
        colors: Colours of the sample, several where objects of one kind differ in colour.
        pattern: Pattern of a line; None of an area.
    """

    name: str
    colors: tuple[Color, ...]
    pattern: LinePattern | None = None


def left_column_px(
    body_px: tuple[int, int], aspect: float | None, max_image_share: float
) -> tuple[int, int]:
    """Return the width of the left column and the height of the image that fills it; 0 without an image.

    Args:
        body_px: (width, height) of both columns.
        aspect: Width of the image over its height, or None without one.
        max_image_share: Share of the height that the image takes at most.
    """
    if aspect is None:
        return round(_COLUMN_SHARE * body_px[0]), 0
    low, high = (share * body_px[0] for share in _COLUMN_SHARES)
    width = min(max(max_image_share * body_px[1] * aspect, low), high)
    return round(width), round(min(width / aspect, max_image_share * body_px[1]))


def place_panel(
    canvas: UInt8, panel: UInt8, corner_px: tuple[int, int], title: str, text_px: int
) -> None:
    """Place a panel with a title in its upper left corner; an empty panel is left out."""
    if not len(panel):
        return
    column, row = corner_px
    height, width = panel.shape[:2]
    target = canvas[row : row + height, column : column + width]
    target[:] = panel
    draw_title(target, title, text_px)


def draw_title(panel: UInt8, title: str, text_px: int) -> None:
    """Write a title on the darkened upper left corner of a panel."""
    right, bottom = title_area_px(title, text_px)[2:].tolist()
    tag = panel[:bottom, :right]
    tag[:] = tag // 3
    draw_text(panel, title, (_TITLE_MARGIN * text_px, 1.5 * text_px + 2), height_px=text_px)


def title_area_px(title: str, text_px: int) -> Int:
    """Return (4,) left, top, right and bottom of a panel's title."""
    width = text_width_px(title, text_px) + 2 * _TITLE_MARGIN * text_px
    return np.array([0, 0, round(width), 2 * text_px + 4])


def draw_legend(canvas: UInt8, legend: Sequence[LegendEntry], text_px: int) -> int:
    """Draw samples with their names in a row from the left; return the column of the end."""
    column, baseline = 1.2 * text_px, 0.5 * (canvas.shape[0] + text_px)
    for entry in legend:
        swatch_px = (1.5 if entry.pattern is None else 3.0) * text_px
        if entry.pattern is None:
            _draw_areas(canvas, entry.colors, (column, baseline - 1.25 * text_px), swatch_px)
        else:
            row = baseline - 0.5 * text_px
            ends_px = np.array([[(column, row), (column + swatch_px, row)]])
            line = Strokes(np.zeros(1, np.int64), ends_px).dashed(entry.pattern)
            draw_strokes(canvas, line, entry.colors, np.array([2]))
        column += swatch_px + 0.7 * text_px
        draw_text(canvas, entry.name, (column, baseline), height_px=text_px)
        column += text_width_px(entry.name, text_px) + 1.8 * text_px
    return round(column)


def _draw_areas(
    canvas: UInt8, colors: Sequence[Color], corner_px: tuple[float, float], size_px: float
) -> None:
    """Fill a square with vertical stripes."""
    edges = np.rint(corner_px[0] + np.linspace(0, size_px, len(colors) + 1)).astype(int)
    rows = slice(round(corner_px[1]), round(corner_px[1] + size_px) + 1)
    for color, left, right in zip(colors, edges[:-1], edges[1:], strict=True):
        canvas[rows, left : right + 1] = color


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
        width, height = _fitted_px(image, largest_px)
        return cls._resized(image, np.empty((height, width, 3), np.uint8))

    @classmethod
    def onto(cls, panel: UInt8, image: UInt8) -> Self:
        """Resize an image to fit onto the top of a panel, centred; the canvas is that part of the panel."""
        panel_px = panel.shape[1]
        width, height = _fitted_px(image, (panel_px, len(panel)))
        left = (panel_px - width) // 2
        if width < panel_px:
            fill_canvas(panel[:height], PANEL)
        return cls._resized(image, panel[:height, left : left + width])

    @classmethod
    def _resized(cls, image: UInt8, canvas: UInt8) -> Self:
        height, width = canvas.shape[:2]
        # Above half the size, bilinear interpolation uses all pixels.
        is_small = width <= 0.5 * image.shape[1]
        interpolation = cv2.INTER_AREA if is_small else cv2.INTER_LINEAR
        cv2.resize(image, (width, height), dst=canvas, interpolation=interpolation)
        whole = np.array([0, 0, image.shape[1], image.shape[0]], np.float64)
        return cls(canvas, Resizing.of_window(whole, (width, height)))

    def on_strip(self, width_px: int) -> UInt8:
        """Return the canvas centred on a strip of a width."""
        height, width = self.canvas.shape[:2]
        strip = blank_canvas((width_px, height), PANEL)
        left = (width_px - width) // 2
        strip[:, left : left + width] = self.canvas
        return strip


def _fitted_px(image: UInt8, largest_px: tuple[int, int]) -> tuple[int, int]:
    """Return the largest (width, height) of an image within others."""
    height, width = image.shape[:2]
    scale = min(largest_px[0] / width, largest_px[1] / height)
    return round(width * scale), round(height * scale)
