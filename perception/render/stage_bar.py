"""The footer of a frame: legend, times of the stages as bars beside one LiDAR revolution, and frame number."""

from collections.abc import Mapping, Sequence

import numpy as np

from perception.render import palette
from perception.render.canvas import Align, draw_text, text_width_px
from perception.render.panels import LegendEntry, draw_legend
from perception.types import Result, StageSpan, UInt8, relative_to_start

_TOP, _BOTTOM = 0.16, 0.40  # ends of all bars, shares of the canvas' height
_BASELINES = {1: (0.82,), 2: (0.65, 0.91)}  # by the number of lines of text
_BAR_SHARES = (0.27, 0.86)  # ends of the bars in the footer, shares of its width


def draw_footer(
    canvas: UInt8, result: Result, legend: Sequence[Sequence[LegendEntry]], turn_s: float
) -> None:
    """Fill the canvas with legend, stage times and frame number.

    Args:
        canvas: Lowest part of an image.
        result: Output of the pipeline.
        legend: Rows of legend entries.
        turn_s: Time of one LiDAR revolution in seconds, the time budget of a frame.
    """
    height, width = canvas.shape[:2]
    text_px = round(0.19 * height)
    row_px = height // len(legend)
    ends_px = [
        draw_legend(canvas[row * row_px : (row + 1) * row_px], entries, text_px)
        for row, entries in enumerate(legend)
    ]
    start, stop = (round(share * width) for share in _BAR_SHARES)
    bar = canvas[:, max([start, *ends_px]) : stop]
    if spans := relative_to_start(result.spans):
        draw_worker_bars(bar, spans, turn_s, round(0.85 * text_px))
    else:
        draw_stage_bar(bar, result.timings_s, turn_s, round(0.85 * text_px))
    for line, text in enumerate(_footer_lines(result)):
        at = (width - 1.2 * text_px, height * (0.42 + 0.4 * line))
        color = palette.FAINT_TEXT if line else palette.TEXT
        draw_text(canvas, text, at, color=color, height_px=text_px, align=Align.RIGHT)


def _footer_lines(result: Result) -> list[str]:
    """Return the processing time of the frame, where it was measured, and number and time of the frame."""
    stops_s = [span.stop_s for span in relative_to_start(result.spans)]
    total_s = max(stops_s, default=sum(result.timings_s.values()))
    which = f"frame {result.frame.index}   {result.frame.stamp_s:.1f} s"
    return [f"{total_s * 1e3:.0f} ms/frame", which] if total_s > 0 else [which]


def draw_stage_bar(
    canvas: UInt8, timings_s: Mapping[str, float], turn_s: float, text_px: int
) -> None:
    """Draw stages that ran one after another as one bar; arguments as of `draw_worker_bars`."""
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

    The full length of the bars is one LiDAR revolution, or the whole time where that is longer.

    Args:
        canvas: (H, W, 3) canvas.
        spans: Stages of the frame, in seconds since the first one began.
        turn_s: Time of one LiDAR revolution in seconds.
        text_px: Height of capitals.
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
    # A frame in time has the mark at the end of the bars, a late one within them.
    turn_px = round(turn_s / full_s * width)
    color = palette.STATIC if turn_px < width else palette.FAINT_TEXT
    canvas[round(0.08 * height) : round(0.46 * height), turn_px - 2 : turn_px] = color
    text = f"{turn_s * 1e3:.0f} ms: one LiDAR revolution"
    taken_px = text_width_px(text, text_px) + _gap_px(text_px)
    at = (width - 2, _write_stages(canvas, spans, taken_px, text_px))
    draw_text(canvas, text, at, color=color, height_px=text_px, align=Align.RIGHT)


def _write_stages(
    canvas: UInt8, spans: Sequence[StageSpan], taken_px: float, text_px: int
) -> float:
    """Write name and time of each stage; return the baseline of the last line, whose end stays free."""
    height, width = canvas.shape[:2]
    labels = [f"{span.stage} {(span.stop_s - span.start_s) * 1e3:.0f}" for span in spans]
    widths_px = [text_width_px(each, text_px) + _gap_px(text_px) for each in labels]
    lines = _lines(widths_px, width + _gap_px(text_px), taken_px)
    baselines_px: list[float] = [share * height for share in _BASELINES[len(lines)]]
    for line, baseline in zip(lines, baselines_px, strict=True):
        column = 0.0
        for number in line:
            at = (column, baseline)
            draw_text(canvas, labels[number], at, color=_color(number), height_px=text_px)
            column += widths_px[number]
    return baselines_px[-1]


def _lines(widths_px: Sequence[float], room_px: float, taken_px: float) -> list[list[int]]:
    """Distribute labels over one line, or evenly over two; the last are left out where there is no room."""
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
