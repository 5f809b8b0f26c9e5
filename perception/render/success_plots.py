"""Shares of right frames as curves, one panel a group. matplotlib is loaded only where one is drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from perception.render import palette
from perception.render.plots import new_figure, rgb, save_figure
from perception.types import Float64

_LINES = ("-", "--", ":", "-.")
_COLUMNS = 3


@dataclass(frozen=True)
class SuccessPanel:
    """The curves of one group of frames.

    Attributes:
        title: which frames.
        x_name: what the curves run over, with unit.
        x_last: where they end; they start at 0 and their values are evenly spaced.
        y_name: what they are.
        curves: by name, (K,) shares from 0 to 1.
        values: by name, what the legend says of the curve.
    """

    title: str
    x_name: str
    x_last: float
    y_name: str
    curves: Mapping[str, Float64]
    values: Mapping[str, str]


def plot_success(
    path: Path, title: str, panels: Sequence[SuccessPanel], columns: int = _COLUMNS
) -> None:
    """Draw the panels side by side; a name has the same colour and dashes in all of them."""
    columns = min(len(panels), columns)
    rows = -(-len(panels) // columns)
    figure = new_figure(0.6 + 4.2 * columns, 0.6 + 3.6 * rows, title)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    names = list(dict.fromkeys(name for panel in panels for name in panel.curves))
    for axes, panel in zip(grid, panels, strict=False):
        for name, curve in panel.curves.items():
            number = names.index(name)
            axes.plot(
                np.linspace(0, panel.x_last, len(curve)),
                curve,
                _LINES[number % len(_LINES)],
                color=rgb(palette.STAGES[number % len(palette.STAGES)]),
                linewidth=1.8,
                label=f"{name}  {panel.values[name]}",
            )
        axes.set(title=panel.title, xlabel=panel.x_name, ylabel=panel.y_name)
        axes.set(xlim=(0, panel.x_last), ylim=(0, 1.02))
        axes.grid(alpha=0.25)
        if panel.curves:
            axes.legend(fontsize=7.5)
        else:
            axes.text(0.5, 0.5, "no frames", ha="center", transform=axes.transAxes, color="grey")
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    save_figure(figure, path)
