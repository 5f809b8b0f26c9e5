"""How far off trackers of one object are over time, a panel for each scene."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from perception.render.plots import new_figure, save_figure
from perception.types import Bool, Float64

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLUMNS = 4
_HIGHEST_M = 4.0  # what is farther off is lost, however far


@dataclass(frozen=True)
class TrackingErrorPanel:
    """One scene.

    Attributes:
        title: of the scene.
        times_s: (K,) of its frames.
        is_hidden: (K,) whether the object is.
        errors_m: (K,) between the centres of the boxes, by tracker; NaN without one.
    """

    title: str
    times_s: Float64
    is_hidden: Bool
    errors_m: Mapping[str, Float64]


def plot_tracking_errors(path: Path, title: str, panels: Sequence[TrackingErrorPanel]) -> None:
    """Draw the error of every tracker in every scene; the first tracker is drawn heavier."""
    rows = -(-len(panels) // _COLUMNS)
    columns = min(len(panels), _COLUMNS)
    figure = new_figure(3.3 * columns + 0.4, 2.5 * rows + 0.9, title)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes, panel in zip(grid.flat, panels, strict=False):
        _draw_panel(axes, panel)
    for axes in grid.flat[len(panels) :]:
        axes.set_axis_off()
    for axes in grid[:, 0]:
        axes.set_ylabel("centre error [m]")
    for axes in grid.flat[max(len(panels) - columns, 0) : len(panels)]:
        axes.set_xlabel("time [s]")
        axes.tick_params(labelbottom=True)
    highest_m = max(_largest_m(panel) for panel in panels)
    grid[0, 0].set_ylim(0, min(1.05 * max(highest_m, 0.5), _HIGHEST_M))
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=9)
    save_figure(figure, path)


def _draw_panel(axes: "Axes", panel: TrackingErrorPanel) -> None:
    axes.set_title(panel.title)
    axes.grid(alpha=0.25)
    step_s = float(np.diff(panel.times_s).mean()) if len(panel.times_s) > 1 else 0.1
    for time_s in panel.times_s[panel.is_hidden]:
        axes.axvspan(time_s - step_s / 2, time_s + step_s / 2, color="0.85", linewidth=0, zorder=0)
    if panel.is_hidden.any():
        middle_s = float(panel.times_s[panel.is_hidden].mean())
        place = axes.get_xaxis_transform()
        axes.text(middle_s, 0.93, "hidden", ha="center", va="top", color="0.4", transform=place)
    for number, (name, errors_m) in enumerate(panel.errors_m.items()):
        width, order = (1.2, 2) if number else (2.4, 3)
        axes.plot(panel.times_s, errors_m, linewidth=width, zorder=order, label=name)


def _largest_m(panel: TrackingErrorPanel) -> float:
    errors = np.concatenate([np.zeros(1), *panel.errors_m.values()])
    return float(np.nanmax(errors))
