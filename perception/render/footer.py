"""Below the views of a frame: what the colours mean, where the time went, and which frame it is."""

from collections.abc import Sequence

from perception.pipeline.clock import relative_to_start
from perception.render import palette
from perception.render.panels import LegendEntry, draw_legend
from perception.render.stage_bar import draw_stage_bar, draw_worker_bars
from perception.render.text import Align, draw_text
from perception.types import Result, UInt8

_BAR_SHARES = (0.27, 0.86)


def draw_footer(
    canvas: UInt8, result: Result, legend: Sequence[Sequence[LegendEntry]], turn_s: float
) -> None:
    """Fill the canvas.

    Args:
        canvas: the lowest part of a picture.
        result: of the frame.
        legend: rows of entries.
        turn_s: time of one turn of the LiDAR, the budget of a frame.
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
    """Return the time that the frame took, where it was taken, and which frame it is."""
    stops_s = [span.stop_s for span in relative_to_start(result.spans)]
    total_s = max(stops_s, default=sum(result.timings_s.values()))
    which = f"frame {result.frame.index}   {result.frame.stamp_s:.1f} s"
    return [f"{total_s * 1e3:.0f} ms for the frame", which] if total_s > 0 else [which]
