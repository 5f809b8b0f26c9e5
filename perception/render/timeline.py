"""When each stage of one frame ran, as bars over time, a row for each worker (as in thesis Fig. 7.17)."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from perception.render import palette
from perception.render.plots import new_figure, rgb, save_figure
from perception.types import StageSpan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Rectangle
    from matplotlib.text import Text

_ROW_IN = 0.9
_BAR = 0.62  # of the height of a row
_LINE = 0.13  # of words above a bar, of the height of a row
# (font size, degrees, whether each word has a line) of what is said of a stage, the best first.
_STYLES = ((8, 0, False), (7, 0, False), (8, 0, True), (7, 0, True), (7, 90, False), (6, 90, False))
_FILLED = 0.92  # of a bar, by its words


def plot_timeline(path: Path, title: str, spans: Sequence[StageSpan], turn_s: float) -> None:
    """Draw the stages of one frame.

    Args:
        path: of the PNG.
        title: above it.
        spans: of the frame's stages, since the first began.
        turn_s: time of one turn of the LiDAR, which is marked.
    """
    workers = list(dict.fromkeys(span.worker for span in spans))
    figure = new_figure(9.0, 1.4 + _ROW_IN * len(workers), title)
    axes = figure.add_subplot()
    axes.set_yticks(range(len(workers)), [_title(worker) for worker in workers])
    last_s = max(turn_s, *(span.stop_s for span in spans))
    axes.set(xlim=(0, 1.04e3 * last_s), xlabel="ms since the first stage began")
    axes.set_ylim(len(workers) - 0.5, -0.5)
    axes.axvline(1e3 * turn_s, color=rgb(palette.STATIC), linestyle="--", linewidth=1)
    axes.text(1e3 * turn_s, len(workers) - 0.52, " one turn of the LiDAR", fontsize=8, va="bottom")
    bars = []
    for number, span in enumerate(spans):
        row, width_ms = workers.index(span.worker), 1e3 * (span.stop_s - span.start_s)
        color = rgb(palette.STAGES[number % len(palette.STAGES)])
        (bar,) = axes.barh(
            row, width_ms, _BAR, left=1e3 * span.start_s, color=color, edgecolor="white"
        )
        bars.append(bar)
    # Only what is laid out tells how large a bar is in the picture.
    figure.draw_without_rendering()
    above: list[Text] = []
    for span, bar in zip(spans, bars, strict=True):
        if not _write_within(axes, bar, span):
            above.append(_write_above(axes, bar, span, above))
    save_figure(figure, path)


def _title(worker: str) -> str:
    """Return the worker's name without the number of a thread that is one of several alike."""
    name, _, number = worker.rpartition("_")
    return name if number.isdecimal() else worker


def _duration(span: StageSpan) -> str:
    return f"{1e3 * (span.stop_s - span.start_s):.1f}"


def _write_within(axes: "Axes", bar: "Rectangle", span: StageSpan) -> bool:
    """Write what a stage is called and took into its bar; tell whether there is room."""
    room = bar.get_window_extent()
    text = axes.text(
        bar.get_x() + bar.get_width() / 2,
        bar.get_y() + bar.get_height() / 2,
        "",
        ha="center",
        va="center",
    )
    for size, degrees, is_split in _STYLES:
        name = span.stage.replace(" ", "\n") if is_split else span.stage
        text.set(text=f"{name}\n{_duration(span)}", fontsize=size, rotation=degrees)
        extent = text.get_window_extent()
        if extent.width < _FILLED * room.width and extent.height < _FILLED * room.height:
            return True
    text.remove()
    return False


def _write_above(
    axes: "Axes", bar: "Rectangle", span: StageSpan, others: Sequence["Text"]
) -> "Text":
    """Write the same above the bar, in the lowest line where no other words stand."""
    text = axes.text(
        bar.get_x(), bar.get_y(), f"{span.stage} {_duration(span)}", fontsize=6, va="bottom"
    )
    if text.get_window_extent().x1 > axes.get_window_extent().x1:
        text.set(x=bar.get_x() + bar.get_width(), ha="right")
    taken = [other.get_window_extent() for other in others]
    while any(text.get_window_extent().overlaps(other) for other in taken):
        text.set_y(text.get_position()[1] - _LINE)
    return text
