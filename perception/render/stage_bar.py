"""The stages' times of one frame as a bar, with one turn of the LiDAR marked on it."""

from collections.abc import Mapping

import numpy as np

from perception.render import palette
from perception.render.text import Align, draw_text, text_width_px
from perception.types import UInt8


def draw_stage_bar(
    canvas: UInt8, timings_s: Mapping[str, float], turn_s: float, text_px: int
) -> None:
    """Fill the canvas with the bar and, below it, the name and time in ms of each stage.

    The bar's full length is one turn of the LiDAR, or the whole time where that is longer.
    """
    height, width = canvas.shape[:2]
    top, bottom = round(0.22 * height), round(0.46 * height)
    canvas[top:bottom] = palette.PANEL
    ends_s = np.cumsum([0.0, *timings_s.values()])
    full_s = max(turn_s, float(ends_s[-1]))
    edges = np.rint(ends_s / full_s * width).astype(int)
    column, baseline = 0.0, 0.82 * height
    for number, (name, seconds) in enumerate(timings_s.items()):
        color = palette.STAGES[number % len(palette.STAGES)]
        canvas[top:bottom, edges[number] : edges[number + 1]] = color
        words = f"{name} {seconds * 1e3:.0f}"
        draw_text(canvas, words, (column, baseline), color=color, height_px=text_px)
        column += text_width_px(words, text_px) + 1.6 * text_px
    # In time the mark stands at the end of the bar, else within it.
    _mark_the_turn(canvas, turn_s, round(turn_s / full_s * width), text_px)


def _mark_the_turn(canvas: UInt8, turn_s: float, column: int, text_px: int) -> None:
    height, width = canvas.shape[:2]
    color = palette.STATIC if column < width else palette.FAINT_TEXT
    canvas[round(0.14 * height) : round(0.54 * height), column - 2 : column] = color
    words = f"{turn_s * 1e3:.0f} ms: one turn of the LiDAR"
    draw_text(
        canvas, words, (width - 2, 0.82 * height), color=color, height_px=text_px, align=Align.RIGHT
    )
