"""Several measures of several methods side by side: curves over a condition, or bars by kind."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from perception.render.plots import new_figure, save_figure
from perception.types import Float64

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHARE_OF_GROUP = 0.8  # the rest is the gap to the next group


@dataclass(frozen=True)
class Condition:
    """What is changed, and what the methods then reach.

    Attributes:
        name: of what is changed, with unit.
        values: (K,) that it takes.
        measures: by name with unit, each method's (K,) values by its name.
    """

    name: str
    values: Sequence[float]
    measures: Mapping[str, Mapping[str, Float64]]


def plot_conditions(path: Path, title: str, conditions: Sequence[Condition]) -> None:
    """Draw a row of panels for each condition, and a column with one scale for each measure."""
    names = list(conditions[0].measures)
    figure = new_figure(3.2 * len(names), 0.9 + 2.7 * len(conditions), title)
    grid = figure.subplots(len(conditions), len(names), sharey="col", squeeze=False)
    for row, condition in zip(grid, conditions, strict=True):
        for axes, name in zip(row, names, strict=True):
            for method, values in condition.measures[name].items():
                axes.plot(condition.values, values, marker="o", markersize=4, label=method)
            axes.set(xlabel=condition.name, title=name, xticks=condition.values)
            axes.set_xticklabels([f"{value:g}" for value in condition.values])
            axes.grid(alpha=0.25)
    _finish(grid.flat)
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=9)
    save_figure(figure, path)


def plot_groups(
    path: Path,
    title: str,
    groups: Sequence[str],
    measures: Mapping[str, Mapping[str, Float64]],
) -> None:
    """Draw a panel for each measure, with a group of bars for each kind and a bar for each method.

    Args:
        path: of the PNG.
        title: of the figure.
        groups: (K,) names of the kinds.
        measures: by name with unit, each method's (K,) values by its name.
    """
    figure = new_figure(3.4 * len(measures), 3.9, title)
    grid = figure.subplots(1, len(measures), squeeze=False)
    places = np.arange(len(groups))
    for axes, (name, methods) in zip(grid[0], measures.items(), strict=True):
        width = _SHARE_OF_GROUP / len(methods)
        for number, (method, values) in enumerate(methods.items()):
            shift = (number - (len(methods) - 1) / 2) * width
            bars = axes.bar(places + shift, values, width, label=method)
            axes.bar_label(bars, fmt="%.0f", fontsize=7, padding=1)
        axes.margins(y=0.08)  # room for the numbers
        axes.set(title=name, xticks=places)
        axes.set_xticklabels(groups)
        axes.axhline(0, color="black", linewidth=0.8)
    _finish(grid.flat)
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=9)
    save_figure(figure, path)


def _finish(panels: "Iterable[Axes]") -> None:
    """Let every scale hold 0, so that a small difference does not look large."""
    for axes in panels:
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.0), max(high, 0.0))
