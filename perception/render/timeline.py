"""When each stage of one frame ran, as bars over time, a row for each worker (as in thesis Fig. 7.17)."""

from collections.abc import Sequence
from pathlib import Path

from perception.render import palette
from perception.render.plots import new_figure, rgb, save_figure
from perception.types import StageSpan

_ROW_IN = 0.9
_BAR = 0.62  # of the height of a row


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
    for number, span in enumerate(spans):
        row, width_ms = workers.index(span.worker), 1e3 * (span.stop_s - span.start_s)
        color = rgb(palette.STAGES[number % len(palette.STAGES)])
        axes.barh(row, width_ms, _BAR, left=1e3 * span.start_s, color=color, edgecolor="white")
        # A name that is longer than its bar stands upright.
        is_narrow = width_ms < 1.6e-2 * len(span.stage) * 1e3 * _last_s(spans, turn_s)
        axes.text(
            1e3 * (span.start_s + span.stop_s) / 2,
            row,
            f"{span.stage}\n{width_ms:.1f}",
            rotation=90 if is_narrow else 0,
            ha="center",
            va="center",
            fontsize=6 if is_narrow else 8,
        )
    axes.axvline(1e3 * turn_s, color=rgb(palette.STATIC), linestyle="--", linewidth=1)
    axes.text(1e3 * turn_s, -0.5, " one turn of the LiDAR", fontsize=8, va="top")
    axes.set_yticks(range(len(workers)), workers)
    axes.set(xlim=(0, 1.04e3 * _last_s(spans, turn_s)), xlabel="ms since the first stage began")
    axes.invert_yaxis()
    save_figure(figure, path)


def _last_s(spans: Sequence[StageSpan], turn_s: float) -> float:
    return max(turn_s, *(span.stop_s for span in spans))
