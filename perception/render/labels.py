"""Labels of objects: text on dark tags beside their boxes, placed by priority without overlap."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.kernels.drawing import best_place
from perception.render import palette
from perception.render.canvas import draw_text, text_width_px
from perception.render.palette import Color
from perception.types import Float64, Int, UInt8

_GAP_PX = 4
# Rows of tags above a box and below it that are tried.
_STACKED = 3


@dataclass(frozen=True)
class Label:
    """Text beside a box.

    Attributes:
        box_px: (4,) x1 y1 x2 y2 around what is labelled, partly on the canvas.
        name: First part of the text, in the colour of the object.
        color: Colour of the object.
        details: Second part of the text.
        is_faint: Whether the second part is grey.
        mark: Colour of the mark at the left end of the tag; None for that of the object.
    """

    box_px: Float64
    name: str
    color: Color
    details: str = ""
    is_faint: bool = False
    mark: Color | None = None

    def size_px(self, text_px: int) -> tuple[int, int]:
        """Return width and height of the tag."""
        width = text_width_px(f"{self.name} {self.details}".strip(), text_px)
        return width + round(1.3 * text_px), round(1.9 * text_px)

    def draw(self, canvas: UInt8, tag_px: Int, text_px: int) -> None:
        """Darken the tag and write the text."""
        left, top, right, bottom = tag_px.tolist()
        tag = canvas[top:bottom, left:right]
        tag[:] = tag // 4
        tag[:, : max(text_px // 3, 3)] = self.color if self.mark is None else self.mark
        column, baseline = left + 0.7 * text_px, top + 1.45 * text_px
        draw_text(canvas, self.name, (column, baseline), color=self.color, height_px=text_px)
        column += text_width_px(f"{self.name} " if self.name else "", text_px)
        tone = palette.FAINT_TEXT if self.is_faint else palette.TEXT
        draw_text(canvas, self.details, (column, baseline), color=tone, height_px=text_px)


def draw_labels(
    canvas: UInt8, labels: Sequence[Label], text_px: int, taken_px: Sequence[Int] = ()
) -> None:
    """Draw labels, the first ones with the highest priority; one without free space is left out.

    Args:
        canvas: (H, W, 3) canvas.
        labels: Labels in the order of their priority.
        text_px: Height of capitals.
        taken_px: (4,) left, top, right and bottom of areas that stay free.
    """
    height, width = canvas.shape[:2]
    boxes_px = np.array([label.box_px for label in labels]).reshape(-1, 4)
    sizes_px = np.array([label.size_px(text_px) for label in labels]).reshape(-1, 2)
    tags_px = place_tags(boxes_px, sizes_px, (width, height), taken_px)
    for label, tag_px in zip(labels, tags_px, strict=True):
        if tag_px[2] > tag_px[0]:
            label.draw(canvas, tag_px, text_px)


def place_tags(
    boxes_px: Float64, sizes_px: Int, canvas_px: tuple[int, int], taken_px: Sequence[Int] = ()
) -> Int:
    """Place tags beside their boxes, one after another, each where it covers the least of all boxes.

    Args:
        boxes_px: (L, 4) x1 y1 x2 y2 of the boxes; x1 > x2 of one that is not visible.
        sizes_px: (L, 2) width and height of the tags.
        canvas_px: (width, height) of the canvas.
        taken_px: (4,) left, top, right and bottom of areas that stay free.

    Returns:
        (L, 4) left, top, right, bottom of the tags in whole pixels, right and bottom exclusive, all on the canvas;
        zeros of a tag that has no box, or no free space.
    """
    boxes = np.clip(boxes_px, 0, np.tile(canvas_px, 2))
    is_visible = (boxes[:, 2:] > boxes[:, :2]).all(axis=1) & (sizes_px <= canvas_px).all(axis=1)
    tags = np.zeros((len(boxes), 4), np.int64)
    avoided = np.ascontiguousarray(boxes[is_visible])
    occupied = np.zeros((len(taken_px) + len(avoided), 4))
    occupied[: len(taken_px)] = np.reshape(taken_px, (-1, 4))
    count = len(taken_px)
    for row in np.flatnonzero(is_visible):
        places = _places(boxes[row], sizes_px[row], canvas_px)
        best = best_place(places, occupied[:count], avoided)
        if best >= 0:
            tags[row] = occupied[count] = places[best]
            count += 1
    return tags


def _places(box_px: Float64, size_px: Int, canvas_px: tuple[int, int]) -> Int:
    """Return the (P, 4) possible places of a tag on the canvas, best first: above, below, beside."""
    x1, y1, x2, y2 = np.rint(box_px).astype(int).tolist()
    width, height = size_px.tolist()
    left, beside = (x1 + x2 - width) // 2, (y1 + y2 - height) // 2
    above, below = y1 - _GAP_PX - height, y2 + _GAP_PX
    aside = (x2 + _GAP_PX, x1 - _GAP_PX - width)
    corners = [(left, above), (left, below), *((column, beside) for column in aside)]
    corners += [(column, row) for row in (above, below) for column in (x1, x2 - width, *aside)]
    for step in range(1, _STACKED):
        corners += [(left, above - step * (height + 2)), (left, below + step * (height + 2))]
    # Where the box fills the canvas, within it.
    corners += [(left, y1 + _GAP_PX), (left, beside)]
    last_column, last_row = canvas_px[0] - width, canvas_px[1] - height
    kept = [
        (min(max(column, 0), last_column), min(max(row, 0), last_row)) for column, row in corners
    ]
    return np.array([(column, row, column + width, row + height) for column, row in kept])
