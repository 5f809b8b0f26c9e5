"""The stages' times of one frame as bars, with one turn of the LiDAR marked on them."""

from collections.abc import Mapping, Sequence

import numpy as np

from perception.render import palette
from perception.render.text import Align, draw_text, text_width_px
from perception.types import StageSpan, UInt8

_TOP, _BOTTOM = 0.22, 0.46  # of the canvas' height, of all bars together


def draw_stage_bar(
    canvas: UInt8, timings_s: Mapping[str, float], turn_s: float, text_px: int
) -> None:
    """Draw stages that ran one after another as one bar, as `draw_worker_bars` does."""
    stops_s = np.cumsum([0.0, *timings_s.values()]).tolist()
    spans = [
        StageSpan(name, "", start_s, stop_s)
        for name, start_s, stop_s in zip(timings_s, stops_s[:-1], stops_s[1:], strict=True)
    ]
    draw_worker_bars(canvas, spans, turn_s, text_px)


def draw_worker_bars(
    canvas: UInt8, spans: Sequence[StageSpan], turn_s: float, text_px: int
) -> None:
    """Fill the canvas with a bar for each worker and, below them, the name and time in ms of each stage.

    The bars' full length is one turn of the LiDAR, or the whole time where that is longer.
    """
    height, width = canvas.shape[:2]
    top, bottom = round(_TOP * height), round(_BOTTOM * height)
    canvas[top:bottom] = palette.PANEL
    workers = list(dict.fromkeys(span.worker for span in spans))
    edges_px = np.rint(np.linspace(top, bottom, len(workers) + 1)).astype(int)
    full_s = max(turn_s, *(span.stop_s for span in spans)) if spans else turn_s
    column, baseline = 0.0, 0.82 * height
    for number, span in enumerate(spans):
        color = palette.STAGES[number % len(palette.STAGES)]
        row = workers.index(span.worker)
        left, right = (round(width * at_s / full_s) for at_s in (span.start_s, span.stop_s))
        canvas[edges_px[row] : edges_px[row + 1], left:right] = color
        words = f"{span.stage} {(span.stop_s - span.start_s) * 1e3:.0f}"
        draw_text(canvas, words, (column, baseline), color=color, height_px=text_px)
        column += text_width_px(words, text_px) + 1.6 * text_px
    # In time the mark stands at the end of the bars, else within them.
    _mark_the_turn(canvas, turn_s, round(turn_s / full_s * width), text_px)


def _mark_the_turn(canvas: UInt8, turn_s: float, column: int, text_px: int) -> None:
    height, width = canvas.shape[:2]
    color = palette.STATIC if column < width else palette.FAINT_TEXT
    canvas[round(0.14 * height) : round(0.54 * height), column - 2 : column] = color
    words = f"{turn_s * 1e3:.0f} ms: one turn of the LiDAR"
    draw_text(
        canvas, words, (width - 2, 0.82 * height), color=color, height_px=text_px, align=Align.RIGHT
    )
