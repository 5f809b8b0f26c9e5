"""Matplotlib figures written as PNG. matplotlib is loaded where a figure is drawn, not on import."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from perception.atomic_file import atomic_file
from perception.render import palette
from perception.render.palette import Color

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DOTS_PER_INCH = 150
_BELOW_AXIS_IN = 0.45  # ticks, their numbers, and the label of the axis
_STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.edgecolor": "none",
    "figure.facecolor": "white",
}


def new_figure(width_in: float, height_in: float, title: str) -> "Figure":
    """Return an empty figure that belongs to no window and to no global state."""
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams.update(_STYLE)
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    figure.suptitle(title, fontsize=12)
    return figure


def legend_below(axes: "Axes", columns: int = 1, title: str | None = None) -> None:
    """Draw the legend of a panel below the label of its x axis, where it hides nothing."""
    from matplotlib.transforms import ScaledTranslation

    figure = axes.figure
    assert figure is not None  # panels are drawn in one
    below = ScaledTranslation(0, -_BELOW_AXIS_IN, figure.dpi_scale_trans)
    axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, 0),
        bbox_transform=axes.transAxes + below,
        ncols=columns,
        fontsize=7.5,
        title=title,
        borderaxespad=0,
    )


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure in the format that the path ends with, else as PNG; all of it or nothing, and make its folder."""
    ending = path.suffix[1:].lower()
    kind = ending if ending in figure.canvas.get_supported_filetypes() else "png"
    with atomic_file(path) as part:
        figure.savefig(part, dpi=_DOTS_PER_INCH, format=kind)


def rgb(color: Color) -> tuple[float, float, float]:
    """Return a colour of the palette in matplotlib's range, 0 to 1."""
    red, green, blue = color
    return red / 255, green / 255, blue / 255


def series_color(number: int) -> tuple[float, float, float]:
    """Return the colour of a curve or bar by its number."""
    return rgb(palette.STAGES[number % len(palette.STAGES)])
