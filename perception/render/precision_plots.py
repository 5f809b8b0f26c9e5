"""Precision over recall as KITTI draws it, one panel a class. matplotlib is loaded only where one is drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from perception.render import palette
from perception.render.plots import new_figure, rgb, save_figure
from perception.types import Float64

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LINES = ("-", "--", ":")


@dataclass(frozen=True)
class PrecisionPanel:
    """The curves of one class.

    Attributes:
        title: which class, and how it is judged.
        curves: by the name in the legend, (K,) precision 0 to 1 at K evenly spaced recalls from 0 to 1.
        legend_title: what the names in the legend say.
        empty_text: what the panel says where there is none.
    """

    title: str
    curves: Mapping[str, Float64]
    legend_title: str = ""
    empty_text: str = "nothing detected"


def plot_precision(path: Path, title: str, panels: Sequence[PrecisionPanel]) -> None:
    """Write a panel a class, its curves told apart by colour and by dashes."""
    save_figure(precision_figure(title, panels), path)


def precision_figure(title: str, panels: Sequence[PrecisionPanel]) -> "Figure":
    """Return the same as a figure."""
    figure = new_figure(0.6 + 3.7 * len(panels), 4.2, title)
    axes_of_panels = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, panel in zip(axes_of_panels, panels, strict=True):
        for number, (name, precision) in enumerate(panel.curves.items()):
            color = rgb(palette.STAGES[number % len(palette.STAGES)])
            line = _LINES[number % len(_LINES)]
            recall = np.linspace(0, 1, len(precision))
            axes.plot(recall, precision, line, color=color, linewidth=2, label=name)
        axes.set(title=panel.title, xlabel="recall", xlim=(0, 1), ylim=(0, 1.02))
        axes.grid(alpha=0.25)
        if panel.curves:
            axes.legend(loc="lower left", title=panel.legend_title)
        else:
            axes.text(0.5, 0.5, panel.empty_text, ha="center", va="center", color="grey")
    axes_of_panels[0].set_ylabel("precision")
    return figure
