"""Bars and maps of metrics: shares of a whole, groups of methods, a metric over two parameters, stages over time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from perception.render import palette
from perception.render.figure import new_figure, rgb, save_figure, series_color
from perception.types import Float64, StageSpan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Rectangle
    from matplotlib.text import Text

_GROUP_WIDTH = 0.8  # share of the distance between two groups of bars
_ROW_IN = 0.9
_BAR_HEIGHT = 0.62  # share of the height of a row
_LINE_HEIGHT = 0.13  # of a label above a bar, share of the height of a row
# (font size, rotation in degrees, one line for each word) of the label in a bar, the best first.
_LABEL_STYLES = (
    (8, 0, False),
    (7, 0, False),
    (8, 0, True),
    (7, 0, True),
    (7, 90, False),
    (6, 90, False),
)
_MAX_FILLED = 0.92  # share of a bar that its label may take


def plot_groups(
    path: Path,
    title: str,
    groups: Sequence[str],
    metrics: Mapping[str, Mapping[str, Float64]],
) -> None:
    """Draw a panel for each metric, with a group of bars for each condition and a bar for each method.

    Args:
        path: Path of the PNG.
        title: Title of the figure.
        groups: (K,) names of the conditions.
        metrics: (K,) values by the name of the metric with unit, then by the name of the method.
    """
    figure = new_figure(3.4 * len(metrics), 3.9, title)
    grid = figure.subplots(1, len(metrics), squeeze=False)
    positions = np.arange(len(groups))
    for axes, (name, methods) in zip(grid[0], metrics.items(), strict=True):
        width = _GROUP_WIDTH / len(methods)
        for number, (method, values) in enumerate(methods.items()):
            shift = (number - (len(methods) - 1) / 2) * width
            bars = axes.bar(positions + shift, values, width, label=method)
            axes.bar_label(bars, fmt="%.0f", fontsize=7, padding=1)
        axes.margins(y=0.08)  # room for the numbers
        axes.set(title=name, xticks=positions)
        axes.set_xticklabels(groups)
        axes.axhline(0, color="black", linewidth=0.8)
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.0), max(high, 0.0))
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=9)
    save_figure(figure, path)


@dataclass(frozen=True)
class ValueGrid:
    """A metric over two parameters.

    Attributes:
        row_name: Parameter of the rows, with unit.
        rows: (R,) values of that parameter.
        column_name: Parameter of the columns, with unit.
        columns: (C,) values of that parameter.
        values: (R, C) values of the metric, NaN where not measured.
        value_name: Name of the metric, with unit.
        digits: Digits of a value after the decimal point.
    """

    row_name: str
    rows: Sequence[float]
    column_name: str
    columns: Sequence[float]
    values: Float64
    value_name: str
    digits: int = 3


def plot_grid(path: Path, title: str, grid: ValueGrid, *, is_low_good: bool) -> None:
    """Draw the values as a heat map with the number in each cell and a frame around the best one."""
    figure = new_figure(6.4, 4.8, title)
    axes = figure.add_subplot()
    image = axes.imshow(
        grid.values, cmap="viridis_r" if is_low_good else "viridis", origin="lower", aspect="auto"
    )
    figure.colorbar(image, label=grid.value_name)
    axes.set_xticks(range(len(grid.columns)), [f"{value:g}" for value in grid.columns])
    axes.set_yticks(range(len(grid.rows)), [f"{value:g}" for value in grid.rows])
    axes.set_xlabel(grid.column_name)
    axes.set_ylabel(grid.row_name)
    middle = float(np.nanmean([np.nanmin(grid.values), np.nanmax(grid.values)]))
    for (row, column), value in np.ndenumerate(grid.values):
        is_dark = (value > middle) == is_low_good
        color = "white" if is_dark else "black"
        axes.text(column, row, f"{value:.{grid.digits}f}", color=color, ha="center", va="center")
    _frame_best(axes, grid.values, is_low_good=is_low_good)
    save_figure(figure, path)


def _frame_best(axes: "Axes", values: Float64, *, is_low_good: bool) -> None:
    from matplotlib.patches import Rectangle

    if np.isnan(values).all():
        return
    best = np.nanargmin(values) if is_low_good else np.nanargmax(values)
    row, column = np.unravel_index(best, values.shape)
    corner = (float(column) - 0.47, float(row) - 0.47)
    axes.add_patch(Rectangle(corner, 0.94, 0.94, fill=False, edgecolor="red", linewidth=2))


def plot_shares(path: Path, title: str, bars: Mapping[str, Mapping[str, float]]) -> None:
    """Draw each bar as shares of its sum; a part has the same colour in every bar.

    Args:
        path: Path of the PNG.
        title: Title of the figure.
        bars: Times by the name of the bar, then by the name of the part.
    """
    figure = new_figure(9.0, 1.2 + 0.75 * len(bars), title)
    axes = figure.add_subplot()
    names = list(dict.fromkeys(part for bar in bars.values() for part in bar))
    colors = dict(zip(names, map(rgb, palette.STAGES * len(names)), strict=False))
    for row, parts in enumerate(bars.values()):
        whole, left = sum(parts.values()), 0.0
        for name, part in parts.items():
            share = 100 * part / whole
            axes.barh(row, share, left=left, color=colors[name], height=0.62)
            if share > 4:
                axes.text(left + share / 2, row, f"{share:.1f}", ha="center", va="center")
            left += share
    axes.set_yticks(range(len(bars)), list(bars))
    axes.invert_yaxis()
    axes.set_xlim(0, 100)
    axes.set_xlabel("share of the time per frame [%]")
    handles = [axes.barh(0, 0, color=colors[name], label=name) for name in names]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1.22), ncols=4)
    save_figure(figure, path)


def plot_timeline(path: Path, title: str, spans: Sequence[StageSpan], period_s: float) -> None:
    """Draw the stages of one frame over time, a row for each worker (as in thesis Fig. 7.17).

    Args:
        path: Path of the PNG.
        title: Title of the figure.
        spans: Stages of the frame, in seconds since the first one began.
        period_s: Time from one scan to the next in seconds, marked by a line.
    """
    workers = list(dict.fromkeys(span.worker for span in spans))
    figure = new_figure(9.0, 1.4 + _ROW_IN * len(workers), title)
    axes = figure.add_subplot()
    axes.set_yticks(range(len(workers)), [_worker_name(worker) for worker in workers])
    last_s = max(period_s, *(span.stop_s for span in spans))
    axes.set(xlim=(0, 1.04e3 * last_s), xlabel="time since the first stage began [ms]")
    axes.set_ylim(len(workers) - 0.5, -0.5)
    axes.axvline(1e3 * period_s, color=rgb(palette.STATIC), linestyle="--", linewidth=1)
    axes.text(1e3 * period_s, len(workers) - 0.52, " next scan", fontsize=8, va="bottom")
    bars = []
    for number, span in enumerate(spans):
        row, width_ms = workers.index(span.worker), 1e3 * (span.stop_s - span.start_s)
        left_ms, color = 1e3 * span.start_s, series_color(number)
        (bar,) = axes.barh(row, width_ms, _BAR_HEIGHT, left_ms, color=color, edgecolor="white")
        bars.append(bar)
    # The size of a bar in pixels is known only after the layout.
    figure.draw_without_rendering()
    above: list[Text] = []
    for span, bar in zip(spans, bars, strict=True):
        if not _label_inside(axes, bar, span):
            above.append(_label_above(axes, bar, span, above))
    save_figure(figure, path)


def _worker_name(worker: str) -> str:
    """Return the worker's name without the number of a thread of a pool."""
    name, _, number = worker.rpartition("_")
    return name if number.isdecimal() else worker


def _duration_ms(span: StageSpan) -> str:
    return f"{1e3 * (span.stop_s - span.start_s):.1f}"


def _label_inside(axes: "Axes", bar: "Rectangle", span: StageSpan) -> bool:
    """Write name and time of a stage into its bar; return whether there is room."""
    room = bar.get_window_extent()
    label = axes.text(
        bar.get_x() + bar.get_width() / 2,
        bar.get_y() + bar.get_height() / 2,
        "",
        ha="center",
        va="center",
    )
    for size, degrees, is_split in _LABEL_STYLES:
        name = span.stage.replace(" ", "\n") if is_split else span.stage
        label.set(text=f"{name}\n{_duration_ms(span)}", fontsize=size, rotation=degrees)
        extent = label.get_window_extent()
        if extent.width < _MAX_FILLED * room.width and extent.height < _MAX_FILLED * room.height:
            return True
    label.remove()
    return False


def _label_above(
    axes: "Axes", bar: "Rectangle", span: StageSpan, others: Sequence["Text"]
) -> "Text":
    """Write name and time of a stage above its bar, in the lowest line without another label."""
    label = axes.text(
        bar.get_x(), bar.get_y(), f"{span.stage} {_duration_ms(span)}", fontsize=6, va="bottom"
    )
    if label.get_window_extent().x1 > axes.get_window_extent().x1:
        label.set(x=bar.get_x() + bar.get_width(), ha="right")
    taken = [other.get_window_extent() for other in others]
    while any(label.get_window_extent().overlaps(other) for other in taken):
        label.set_y(label.get_position()[1] - _LINE_HEIGHT)
    return label
