"""Figures of the studies, as PNG. matplotlib is loaded only where one is drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from perception.render import palette
from perception.render.palette import Color
from perception.types import Float64

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DOTS_PER_INCH = 150
_STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    # Words over curves stay words.
    "legend.framealpha": 0.8,
    "legend.edgecolor": "none",
    "figure.facecolor": "white",
}


def new_figure(width_in: float, height_in: float, title: str) -> "Figure":
    """Return a figure that belongs to no window and to no global state."""
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams.update(_STYLE)
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    figure.suptitle(title, fontsize=12)
    return figure


def save_figure(figure: "Figure", path: Path) -> None:
    """Write the figure whole or not at all, making its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.part.png")
    figure.savefig(temporary, dpi=_DOTS_PER_INCH)
    temporary.replace(path)


def rgb(color: Color) -> tuple[float, float, float]:
    """Return a colour of the palette as matplotlib wants it."""
    red, green, blue = color
    return red / 255, green / 255, blue / 255


@dataclass(frozen=True)
class ValueGrid:
    """One figure of merit over two parameters.

    Attributes:
        row_name: what changes from row to row.
        rows: (R,) its values.
        column_name: what changes from column to column.
        columns: (C,) its values.
        values: (R, C); NaN where nothing was measured.
        value_name: what they are, with unit.
        digits: of a value after the point.
    """

    row_name: str
    rows: Sequence[float]
    column_name: str
    columns: Sequence[float]
    values: Float64
    value_name: str
    digits: int = 3


def plot_grid(path: Path, title: str, grid: ValueGrid, *, is_low_good: bool) -> None:
    """Draw the values as a map with the number in each cell, the best one framed."""
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
    """Draw each bar as shares of its whole; a part has the same colour in every bar.

    Args:
        path: of the PNG.
        title: of the figure.
        bars: by the bar's name, the parts by name.
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
    axes.set_xlabel("share of the time of a frame [%]")
    handles = [axes.barh(0, 0, color=colors[name], label=name) for name in names]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1.22), ncols=4)
    save_figure(figure, path)


@dataclass(frozen=True)
class Curve:
    """One line of a plot.

    Attributes:
        name: in the legend.
        x: (K,) positions.
        y: (K,) values, above zero.
        is_emphasised: drawn heavier than the others.
    """

    name: str
    x: Sequence[float]
    y: Float64
    is_emphasised: bool = False


def plot_curves(
    path: Path, title: str, curves: Sequence[Curve], axis_names: tuple[str, str]
) -> None:
    """Draw the curves on a logarithmic scale, each value marked.

    Markers shrink from curve to curve, so that curves on top of each other are all seen.
    """
    figure = new_figure(7.2, 4.8, title)
    axes = figure.add_subplot()
    for number, curve in enumerate(curves):
        width, size = (3.0, 7) if curve.is_emphasised else (1.3, max(12 - 3 * number, 3))
        axes.plot(curve.x, curve.y, marker="o", markersize=size, linewidth=width, label=curve.name)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.set_xticks(curves[0].x)
    axes.grid(which="both", alpha=0.25)
    axes.set(xlabel=axis_names[0], ylabel=axis_names[1])
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    save_figure(figure, path)
