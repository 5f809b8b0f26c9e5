"""The stages' times of one frame as a bar whose full length is one turn of the LiDAR."""

from collections.abc import Mapping

import numpy as np

from perception.render import palette
from perception.render.text import Align, draw_text, text_width_px
from perception.types import UInt8


def draw_stage_bar(
    canvas: UInt8, timings_s: Mapping[str, float], turn_s: float, text_px: int
) -> None:
    """Fill the canvas with the bar and, below it, the name and time of each stage."""
    height, width = canvas.shape[:2]
    top, bottom = round(0.22 * height), round(0.46 * height)
    canvas[top:bottom] = palette.PANEL
    ends = np.cumsum([0.0, *timings_s.values()]) / turn_s * width
    edges = np.clip(np.rint(ends), 0, width).astype(int)
    column, baseline = 0.0, 0.82 * height
    for number, (name, seconds) in enumerate(timings_s.items()):
        color = palette.STAGES[number % len(palette.STAGES)]
        canvas[top:bottom, edges[number] : edges[number + 1]] = color
        words = f"{name} {seconds * 1e3:.0f}"
        draw_text(canvas, words, (column, baseline), color=color, height_px=text_px)
        column += text_width_px(words, text_px) + 1.6 * text_px
    _mark_the_turn(canvas, turn_s, text_px, is_late=bool(ends[-1] > width))


def _mark_the_turn(canvas: UInt8, turn_s: float, text_px: int, *, is_late: bool) -> None:
    height, width = canvas.shape[:2]
    color = palette.STATIC if is_late else palette.FAINT_TEXT
    canvas[round(0.14 * height) : round(0.54 * height), -2:] = color
    words = f"{turn_s * 1e3:.0f} ms: one turn of the LiDAR"
    draw_text(
        canvas, words, (width - 2, 0.82 * height), color=color, height_px=text_px, align=Align.RIGHT
    )
