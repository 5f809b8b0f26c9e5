"""Matplotlib figures written as PNG. matplotlib is loaded where a figure is drawn, not on import."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from perception.atomic_file import atomic_file
from perception.render import palette
from perception.render.palette import Color

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DOTS_PER_INCH = 150
_STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    # Keeps a legend readable over the curves behind it.
    "legend.framealpha": 0.8,
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


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure as PNG, all of it or nothing, and make its folder."""
    with atomic_file(path) as part:
        figure.savefig(part, dpi=_DOTS_PER_INCH)


def rgb(color: Color) -> tuple[float, float, float]:
    """Return a colour of the palette in matplotlib's range, 0 to 1."""
    red, green, blue = color
    return red / 255, green / 255, blue / 255


def series_color(number: int) -> tuple[float, float, float]:
    """Return the colour of a curve or bar by its number."""
    return rgb(palette.STAGES[number % len(palette.STAGES)])
