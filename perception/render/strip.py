"""The strip below the views of a frame: legend, maps, times of the stages beside the period of the scans, and clock."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np

from perception.render import palette
from perception.render.canvas import Align, blank_canvas, draw_text, text_width_px
from perception.render.panels import LegendEntry, draw_legend
from perception.render.scene import Scene
from perception.types import Health, HealthLevel, StageSpan, UInt8, relative_to_start

_MAX_LINES = 3
_MARGIN, _LINE = 0.8, 1.9  # in heights of the text
# Orange and red that the colour blind tell apart (Okabe and Ito 2008).
_COLORS = {HealthLevel.WARN: (230, 159, 0), HealthLevel.ERROR: (255, 96, 64)}
_TOP, _BOTTOM = 0.16, 0.40  # ends of all bars, shares of the canvas' height
_LINE_TEXTS = 1.7  # distance of two lines of text below the bars, in heights of the text
_CLOCK_TEXTS = 13  # width of the clock, in heights of the text
_ROW_TEXTS = 2.3  # distance of two rows of the legend
_GUTTER_PX = 4


def draw_health(canvas: UInt8, health: Health, text_px: int) -> None:
    """Write level and name of the worst faults, upper left, on a dark ground.

    Args:
        canvas: (H, W, 3) image.
        health: Health of the frame.
        text_px: Height of capitals.
    """
    levels: dict[str, HealthLevel] = {}
    for one in health.findings:
        levels.setdefault(one.fault, one.level)
    margin, line = round(_MARGIN * text_px), round(_LINE * text_px)
    for row, (fault, level) in enumerate(list(levels.items())[:_MAX_LINES]):
        text = f"{level.name}  {fault}"
        top, width = margin + row * line, text_width_px(text, text_px)
        canvas[top : top + line, margin : 3 * margin + width] = palette.BACKGROUND
        at = (2 * margin, top + (line + text_px) / 2)
        draw_text(canvas, text, at, color=_COLORS[level], height_px=text_px)


def draw_strip(
    canvas: UInt8,
    scene: Scene,
    legend: Sequence[Sequence[LegendEntry]],
    insets: Mapping[str, UInt8],
    period_s: float,
    text_px: int,
) -> None:
    """Fill the canvas with legend, insets, stage times and clock, from left to right.

    Args:
        canvas: Lowest part of an image.
        scene: Content of the image.
        legend: Rows of legend entries.
        insets: Small images by title, at most as high as the canvas.
        period_s: Time from one scan to the next in seconds, the time budget of a frame.
        text_px: Height of capitals.
    """
    height, width = canvas.shape[:2]
    drawn = _legend_image(tuple(legend), (width, height), text_px)
    column = drawn.shape[1]
    canvas[:, :column] = drawn
    for title, inset in insets.items():
        top = (height - len(inset) + _title_height_px(text_px)) // 2
        canvas[top : top + len(inset), column : column + inset.shape[1]] = inset
        at = (column, top - 0.7 * text_px)
        draw_text(canvas, title, at, color=palette.FAINT_TEXT, height_px=text_px)
        column += inset.shape[1] + _GUTTER_PX
    clock_px = _CLOCK_TEXTS * text_px
    bars = canvas[:, column + 2 * text_px : width - clock_px - text_px]
    if spans := relative_to_start(scene.result.spans):
        draw_worker_bars(bars, spans, period_s, text_px)
    else:
        draw_stage_bar(bars, scene.result.timings_s, period_s, text_px)
    lines = _clock_lines(scene)
    rows_px = _row_edges_px(height, len(lines), text_px)
    for number, ((top, bottom), text) in enumerate(zip(pairwise(rows_px), lines, strict=True)):
        at = (width - 1.2 * text_px, (top + bottom + text_px) / 2)
        color = palette.FAINT_TEXT if number else palette.TEXT
        draw_text(canvas, text, at, color=color, height_px=text_px, align=Align.RIGHT)


@lru_cache(maxsize=8)
def _legend_image(
    legend: Sequence[Sequence[LegendEntry]], size_px: tuple[int, int], text_px: int
) -> UInt8:
    """Return the rows of a legend as an image as wide as they are; a video has few legends."""
    canvas = blank_canvas(size_px, palette.BACKGROUND)
    rows_px = _row_edges_px(size_px[1], len(legend), text_px)
    columns = [
        draw_legend(canvas[top:bottom], entries, text_px)
        for (top, bottom), entries in zip(pairwise(rows_px), legend, strict=True)
    ]
    return canvas[:, : max(columns)]


def inset_height_px(height: int, text_px: int) -> int:
    """Return the largest height of the insets in a strip of a height."""
    return height - _title_height_px(text_px) - _GUTTER_PX


def _title_height_px(text_px: int) -> int:
    return 2 * text_px


def _row_edges_px(height: int, count: int, text_px: int) -> list[int]:
    """Return the edges of rows of text, centred, and close where there is room."""
    half_px = min(height, _ROW_TEXTS * text_px * count) / 2
    edges = height / 2 + np.linspace(-half_px, half_px, count + 1)
    return [round(edge) for edge in edges.tolist()]


def _clock_lines(scene: Scene) -> list[str]:
    """Return number and time of the frame, the speed of the vehicle, and the processing time, where known."""
    frame = scene.result.frame
    lines = [f"frame {frame.index}", f"{frame.stamp_s:.1f} s"]
    if np.isfinite(scene.ego_speed_m_s):
        lines.append(f"ego {scene.ego_speed_m_s:.1f} m/s")
    stops_s = [span.stop_s for span in relative_to_start(scene.result.spans)]
    total_s = max(stops_s, default=sum(scene.result.timings_s.values()))
    return [*lines, f"{total_s * 1e3:.0f} ms/frame"] if total_s > 0 else lines


def draw_stage_bar(
    canvas: UInt8, timings_s: Mapping[str, float], period_s: float, text_px: int
) -> None:
    """Draw stages that ran one after another as one bar; arguments as of `draw_worker_bars`."""
    stops_s = np.cumsum([0.0, *timings_s.values()]).tolist()
    spans = [
        StageSpan(name, "", start_s, stop_s)
        for name, start_s, stop_s in zip(timings_s, stops_s[:-1], stops_s[1:], strict=True)
    ]
    draw_worker_bars(canvas, spans, period_s, text_px)


def draw_worker_bars(
    canvas: UInt8, spans: Sequence[StageSpan], period_s: float, text_px: int
) -> None:
    """Fill the canvas with a bar for each worker and, below them, the name and time in ms of each stage.

    The full length of the bars is the period of the scans, or the whole time where that is longer.

    Args:
        canvas: (H, W, 3) canvas.
        spans: Stages of the frame, in seconds since the first one began.
        period_s: Time from one scan to the next in seconds.
        text_px: Height of capitals.
    """
    height, width = canvas.shape[:2]
    top, bottom = round(_TOP * height), round(_BOTTOM * height)
    canvas[top:bottom] = palette.PANEL
    workers = list(dict.fromkeys(span.worker for span in spans))
    edges_px = np.rint(np.linspace(top, bottom, len(workers) + 1)).astype(int)
    full_s = max(period_s, *(span.stop_s for span in spans)) if spans else period_s
    for number, span in enumerate(spans):
        row = workers.index(span.worker)
        left, right = (round(width * at_s / full_s) for at_s in (span.start_s, span.stop_s))
        canvas[edges_px[row] : edges_px[row + 1], left:right] = _color(number)
    # A frame in time has the mark at the end of the bars, a late one within them.
    turn_px = round(period_s / full_s * width)
    color = palette.STATIC if turn_px < width else palette.FAINT_TEXT
    canvas[round(0.08 * height) : round(0.46 * height), turn_px - 2 : turn_px] = color
    text = f"{period_s * 1e3:.0f} ms: the next scan"
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
    pitch_px = _LINE_TEXTS * text_px
    max_lines = int((1 - _BOTTOM) * height / pitch_px)
    lines = _lines(widths_px, width + _gap_px(text_px), taken_px, max_lines)
    baseline = round(_BOTTOM * height) + pitch_px
    for line in lines:
        column = 0.0
        for number in line:
            at = (column, baseline)
            draw_text(canvas, labels[number], at, color=_color(number), height_px=text_px)
            column += widths_px[number]
        baseline += pitch_px
    return float(baseline - pitch_px)


def _lines(
    widths_px: Sequence[float], room_px: float, taken_px: float, max_lines: int
) -> list[list[int]]:
    """Distribute labels over lines; the last line keeps its end free, and labels without room are left out."""
    lines: list[list[int]] = [[]]
    column = 0.0
    for number, width_px in enumerate(widths_px):
        if column + width_px > room_px and len(lines) < max_lines:
            lines.append([])
            column = 0.0
        if column + width_px > room_px - taken_px * (len(lines) == max_lines):
            break
        lines[-1].append(number)
        column += width_px
    if column + taken_px > room_px and len(lines) < max_lines:
        lines.append([])
    return lines


def _gap_px(text_px: int) -> float:
    return 1.6 * text_px


def _color(number: int) -> palette.Color:
    return palette.STAGES[number % len(palette.STAGES)]
