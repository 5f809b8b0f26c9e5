"""Curves in panels: precision over recall, success, recall of proposals, metrics over a condition, errors over time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self

import numpy as np

from perception.render.figure import legend_below, new_figure, save_figure, series_color
from perception.types import Bool, Float64

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from perception.evaluation.detection.proposal_recall import ProposalRecall

ShareY = Literal["none", "row", "col", "all"]

_PANEL_IN = (3.7, 3.5)
# Five, so that the curves of two similar colours differ.
_DASHES = ("-", "--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)))
_MAX_MARKERS = 20  # above this number of values, curves have no markers
_MAX_ERROR_M = 4.0  # larger tracking errors are not drawn: the track is lost
_MAX_PROPOSALS = 200  # right end of the curves over the number of proposals


@dataclass(frozen=True)
class Curve:
    """One curve of a panel.

    Attributes:
        name: Name in the legend; a name has the same colour in all panels.
        x: (K,) positions.
        y: (K,) values, NaN where unknown.
        note: Value in the legend, behind the name.
        is_emphasised: Whether the curve is drawn heavier than the others.
    """

    name: str
    x: Sequence[float] | Float64
    y: Sequence[float] | Float64
    note: str = ""
    is_emphasised: bool = False

    @classmethod
    def evenly_spaced(cls, name: str, y: Float64, x_max: float = 1.0, note: str = "") -> Self:
        """Return a curve of values at evenly spaced positions from 0 to x_max."""
        return cls(name, np.linspace(0, x_max, len(y)), y, note)

    @property
    def label(self) -> str:
        """Name and note."""
        return f"{self.name}  {self.note}".strip()


@dataclass(frozen=True)
class CurvePanel:
    """Curves over one pair of axes.

    Attributes:
        title: Title of the panel.
        x_label: Quantity and unit along x.
        y_label: Quantity and unit along y.
        curves: Curves in the order of the legend.
        x_limits: Ends of the x axis; else those of the curves.
        y_limits: Ends of the y axis; else those of the curves and 0.
        x_ticks: Positions of the ticks; else matplotlib's.
        shaded: Intervals of x with a grey background.
        legend_title: Title of the legend.
        empty_text: Text of a panel without curves.
    """

    title: str
    x_label: str
    y_label: str
    curves: Sequence[Curve]
    x_limits: tuple[float, float] | None = None
    y_limits: tuple[float, float] | None = None
    x_ticks: Sequence[float] | None = None
    shaded: Sequence[tuple[float, float]] = ()
    legend_title: str = ""
    empty_text: str = "no frames"


def precision_panel(
    title: str, curves: Mapping[str, Float64], legend_title: str = ""
) -> CurvePanel:
    """Return a panel of precision over recall, as KITTI draws it.

    Args:
        title: Class and how detections are matched.
        curves: (K,) precision at evenly spaced recalls from 0 to 1, by `name: note` of the legend.
        legend_title: Title of the legend.
    """
    return CurvePanel(
        title,
        "recall",
        "precision",
        [
            Curve.evenly_spaced(name.partition(": ")[0], precision, note=name.partition(": ")[2])
            for name, precision in curves.items()
        ],
        x_limits=(0, 1),
        y_limits=(0, 1.02),
        legend_title=legend_title,
        empty_text="nothing detected",
    )


def metric_panels(
    x_label: str, x: Sequence[float], metrics: Mapping[str, Mapping[str, Float64]]
) -> list[CurvePanel]:
    """Return a panel for each metric over a condition.

    Args:
        x_label: Condition and its unit.
        x: (K,) values of the condition.
        metrics: (K,) values by the name of the metric with unit, then by the name of the method.
    """
    return [
        CurvePanel(
            name, x_label, "", [Curve(method, x, y) for method, y in methods.items()], x_ticks=x
        )
        for name, methods in metrics.items()
    ]


def tracking_error_panel(
    title: str, times_s: Float64, is_hidden: Bool, errors_m: Mapping[str, Float64]
) -> CurvePanel:
    """Return a panel of the errors of trackers of one object over time, the first one emphasised.

    Args:
        title: Name of the scene.
        times_s: (K,) times of the frames.
        is_hidden: (K,) mask of the frames in which the object is hidden, shaded in grey.
        errors_m: (K,) distance between the centres of the boxes by tracker, NaN without a box.
    """
    half_s = float(np.diff(times_s).mean()) / 2 if len(times_s) > 1 else 0.05
    return CurvePanel(
        title,
        "time [s], grey: hidden",
        "centre error [m]",
        [
            Curve(name, times_s, _drop_lost(errors), is_emphasised=number == 0)
            for number, (name, errors) in enumerate(errors_m.items())
        ],
        shaded=[(time_s - half_s, time_s + half_s) for time_s in times_s[is_hidden].tolist()],
    )


def _drop_lost(errors_m: Float64) -> Float64:
    with np.errstate(invalid="ignore"):
        return np.where(errors_m > _MAX_ERROR_M, np.nan, errors_m)


def recall_by_count_panels(recalls: Mapping[str, "ProposalRecall"]) -> list[CurvePanel]:
    """Return panels of recall over the number of proposals, a row for each IoU, a column for each difficulty.

    Args:
        recalls: Recall of the proposals by the name of the setting.
    """
    count = max(1, *(min(recall.max_per_frame, _MAX_PROPOSALS) for recall in recalls.values()))
    difficulties = next(iter(recalls.values())).difficulties
    return [
        CurvePanel(
            f"{difficulty}: {metrics.objects} objects, IoU {iou:g}",
            "proposals per frame",
            "recall",
            [
                Curve.evenly_spaced(
                    name,
                    recall.difficulties[difficulty].recall_by_count(iou, count),
                    count,
                    f"{100 * recall.difficulties[difficulty].recall(iou):.1f} %",
                )
                for name, recall in recalls.items()
                if recall.difficulties[difficulty].objects
            ],
            x_limits=(0, count),
            y_limits=(0, 1.02),
            empty_text="no objects",
        )
        for iou in next(iter(difficulties.values())).ranks
        for difficulty, metrics in difficulties.items()
    ]


def recall_by_iou_panels(recalls: Mapping[str, "ProposalRecall"]) -> list[CurvePanel]:
    """Return panels of the recall of all proposals over the IoU, one for each difficulty.

    Args:
        recalls: Recall of the proposals by the name of the setting.
    """
    from perception.evaluation.detection.proposal_recall import IOU_STEPS

    difficulties = next(iter(recalls.values())).difficulties
    iou = next(iter(next(iter(difficulties.values())).ranks))
    last_iou = float(IOU_STEPS[-1])
    return [
        CurvePanel(
            f"{difficulty}: {metrics.objects} objects",
            "minimum IoU of the best proposal",
            "recall",
            [
                Curve.evenly_spaced(
                    name,
                    recall.difficulties[difficulty].recall_by_iou(),
                    last_iou,
                    f"{100 * recall.difficulties[difficulty].recall(iou):.1f} % at IoU {iou:g}",
                )
                for name, recall in recalls.items()
                if recall.difficulties[difficulty].objects
            ],
            x_limits=(0, last_iou),
            y_limits=(0, 1.02),
            empty_text="no objects",
        )
        for difficulty, metrics in difficulties.items()
    ]


def plot_curves(
    path: Path,
    title: str,
    panels: Sequence[CurvePanel],
    *,
    columns: int = 3,
    share_y: ShareY = "none",
) -> None:
    """Draw panels of curves into a PNG.

    Args:
        path: Path of the PNG.
        title: Title of the figure.
        panels: Panels, row by row.
        columns: Maximum number of panels in a row.
        share_y: Panels that have one scale along y.
    """
    save_figure(curve_figure(title, panels, columns=columns, share_y=share_y), path)


def curve_figure(
    title: str, panels: Sequence[CurvePanel], *, columns: int = 3, share_y: ShareY = "none"
) -> "Figure":
    """Return panels of curves as a figure; arguments as of `plot_curves`."""
    columns = min(len(panels), columns)
    rows = -(-len(panels) // columns)
    width_in, height_in = _PANEL_IN
    figure = new_figure(0.6 + width_in * columns, 0.7 + height_in * rows, title)
    grid = figure.subplots(rows, columns, squeeze=False, sharey=share_y)
    names = list(dict.fromkeys(curve.name for panel in panels for curve in panel.curves))
    for axes, panel in zip(grid.flat, panels, strict=False):
        _draw_panel(axes, panel, names)
    for axes, panel in zip(grid.flat, panels, strict=False):
        if panel.y_limits is None:
            _include_zero(axes)
    for axes in grid.flat[len(panels) :]:
        axes.set_axis_off()
    _draw_legends(figure, list(grid.flat), panels)
    return figure


def _draw_panel(axes: "Axes", panel: CurvePanel, names: Sequence[str]) -> None:
    for start, stop in panel.shaded:
        axes.axvspan(start, stop, color="0.85", linewidth=0, zorder=0)
    for curve in panel.curves:
        number, has_markers = names.index(curve.name), len(curve.x) <= _MAX_MARKERS
        axes.plot(
            curve.x,
            curve.y,
            linestyle="-" if has_markers else _DASHES[number % len(_DASHES)],
            marker="o" if has_markers else "",
            markersize=4,
            color=series_color(number),
            linewidth=3.0 if curve.is_emphasised else 1.8,
            label=curve.label,
        )
    axes.set(title=panel.title, xlabel=panel.x_label, ylabel=panel.y_label)
    axes.grid(alpha=0.25)
    if not panel.curves:
        place = axes.transAxes
        axes.text(0.5, 0.5, panel.empty_text, ha="center", transform=place, color="grey")
    if panel.x_ticks is not None:
        axes.set_xticks(panel.x_ticks, [f"{value:g}" for value in panel.x_ticks])
    if panel.x_limits is not None:
        axes.set_xlim(*panel.x_limits)
    if panel.y_limits is not None:
        axes.set_ylim(*panel.y_limits)


def _include_zero(axes: "Axes") -> None:
    """Extend the scale to 0, so that a small difference does not look large."""
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.0), max(high, 0.0))


def _draw_legends(
    figure: "Figure", all_axes: Sequence["Axes"], panels: Sequence[CurvePanel]
) -> None:
    """Draw one legend below panels with the same curves, else one below each panel."""
    labels = {tuple(curve.label for curve in panel.curves) for panel in panels}
    if len(panels) > 1 and len(labels) == 1 and labels != {()}:
        handles = all_axes[0].get_legend_handles_labels()
        title = panels[0].legend_title
        figure.legend(*handles, loc="outside lower center", ncols=6, title=title)
        return
    for axes, panel in zip(all_axes, panels, strict=False):
        if panel.curves:
            legend_below(axes, title=panel.legend_title)
