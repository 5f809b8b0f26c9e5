"""The stages' times of one frame as bars, with one turn of the LiDAR marked on them."""

from collections.abc import Mapping, Sequence

import numpy as np

from perception.render import palette
from perception.render.text import Align, draw_text, text_width_px
from perception.types import StageSpan, UInt8

_TOP, _BOTTOM = 0.16, 0.40  # of the canvas' height, of all bars together
_BASELINES = {1: (0.82,), 2: (0.65, 0.91)}  # by the number of lines of words


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
    for number, span in enumerate(spans):
        row = workers.index(span.worker)
        left, right = (round(width * at_s / full_s) for at_s in (span.start_s, span.stop_s))
        canvas[edges_px[row] : edges_px[row + 1], left:right] = _color(number)
    # In time the mark stands at the end of the bars, else within them.
    turn_px = round(turn_s / full_s * width)
    color = palette.STATIC if turn_px < width else palette.FAINT_TEXT
    canvas[round(0.08 * height) : round(0.46 * height), turn_px - 2 : turn_px] = color
    text = f"{turn_s * 1e3:.0f} ms: one turn of the LiDAR"
    taken_px = text_width_px(text, text_px) + _gap_px(text_px)
    at = (width - 2, _write_stages(canvas, spans, taken_px, text_px))
    draw_text(canvas, text, at, color=color, height_px=text_px, align=Align.RIGHT)


def _write_stages(
    canvas: UInt8, spans: Sequence[StageSpan], taken_px: float, text_px: int
) -> float:
    """Write the name and time of each stage; return the last line's baseline, whose end is kept free."""
    height, width = canvas.shape[:2]
    text = [f"{span.stage} {(span.stop_s - span.start_s) * 1e3:.0f}" for span in spans]
    widths_px = [text_width_px(each, text_px) + _gap_px(text_px) for each in text]
    lines = _lines(widths_px, width + _gap_px(text_px), taken_px)
    baselines_px: list[float] = [share * height for share in _BASELINES[len(lines)]]
    for line, baseline in zip(lines, baselines_px, strict=True):
        column = 0.0
        for number in line:
            at = (column, baseline)
            draw_text(canvas, text[number], at, color=_color(number), height_px=text_px)
            column += widths_px[number]
    return baselines_px[-1]


def _lines(widths_px: Sequence[float], room_px: float, taken_px: float) -> list[list[int]]:
    """Share out words to one line, or evenly to two; the last are left out where they find no room."""
    total_px = sum(widths_px) + taken_px
    if total_px <= room_px:
        return [list(range(len(widths_px)))]
    ends_px = np.cumsum([0.0, *widths_px])
    fitting = int(np.searchsorted(ends_px, room_px, side="right")) - 1
    first = min(fitting, int(np.searchsorted(ends_px, total_px / 2)))
    reached_px = ends_px[first] + room_px - taken_px
    last = int(np.searchsorted(ends_px, reached_px, side="right")) - 1
    return [list(range(first)), list(range(first, last))]


def _gap_px(text_px: int) -> float:
    return 1.6 * text_px


def _color(number: int) -> palette.Color:
    return palette.STAGES[number % len(palette.STAGES)]
