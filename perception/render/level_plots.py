"""Figures of merit over the level of what disturbs them, as PNG, one panel a disturbance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from perception.render import palette
from perception.render.plots import new_figure, rgb, save_figure


@dataclass(frozen=True)
class LevelPanel:
    """What one disturbance does.

    Attributes:
        axis_name: of the disturbance, with its unit.
        levels: (K) at which it was measured, rising.
        values: by the name in the legend, (K) figures; NaN where there is none.
    """

    axis_name: str
    levels: Sequence[float]
    values: Mapping[str, Sequence[float]]


def plot_levels(path: Path, title: str, value_name: str, panels: Sequence[LevelPanel]) -> None:
    """Draw all panels side by side on one scale, the last curve of each heavier."""
    figure = new_figure(0.8 + 3.4 * len(panels), 4.2, title)
    axes_of_panels = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, panel in zip(axes_of_panels, panels, strict=True):
        for number, (name, values) in enumerate(panel.values.items()):
            color = rgb(palette.STAGES[number % len(palette.STAGES)])
            width = 3.0 if number == len(panel.values) - 1 else 1.5
            axes.plot(panel.levels, values, marker="o", color=color, linewidth=width, label=name)
        axes.set(xlabel=panel.axis_name)
        axes.set_xticks(panel.levels, [f"{level:g}" for level in panel.levels])
        axes.grid(alpha=0.25)
    axes_of_panels[0].set(ylabel=value_name)
    axes_of_panels[0].set_ylim(bottom=0)
    axes_of_panels[-1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    save_figure(figure, path)
