"""Figures as Plotly's JSON: curves, bars and matrices; the page gives them the colours of its theme.

The schema is that of https://plotly.com/javascript/reference: `data` holds the traces, `layout` the axes. They are
plain dictionaries, as Plotly's own classes take a quarter of a second to import and validate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from data.results.objects import numbers
from perception.render.curve_plots import Curve, CurvePanel
from perception.types import Float64

PlotlyFigure = dict[str, Any]

_HEIGHT_PX = 340
_MARGIN_PX = {"l": 60, "r": 16, "t": 14, "b": 48}
_MAX_UNIFIED = 6  # more curves than these have a box of their own for the value under the pointer
_MAX_POINTS = 3000  # of a curve; longer ones are thinned
COLORS = 11  # of the theme, in page.css


@dataclass(frozen=True)
class LineStyle:
    """Style of a curve.

    Attributes:
        color: Number of its colour in the theme.
        is_dashed: Whether the line is dashed.
    """

    color: int
    is_dashed: bool = False

    @classmethod
    def of(cls, number: int) -> Self:
        """Return the style of a curve by its number: solid ones first, then dashed ones."""
        return cls(number % COLORS, number % (2 * COLORS) >= COLORS)


@dataclass(frozen=True)
class CurveOptions:
    """Options of a figure of curves.

    Attributes:
        limits: Horizontal lines by name.
        has_cursor: Whether x is the frame that the player shows, marked by a line.
        styles: Styles by the name of the curve; else colours in the order of the curves.
        has_equal_axes: Whether both axes have one scale, as of a map.
        has_markers: Whether each value is marked.
    """

    limits: Mapping[str, float] = field(default_factory=dict)
    has_cursor: bool = False
    styles: Mapping[str, LineStyle] = field(default_factory=dict)
    has_equal_axes: bool = False
    has_markers: bool = False


def curves_figure(panel: CurvePanel, options: CurveOptions | None = None) -> PlotlyFigure:
    """Return the curves of a panel as a figure."""
    options = CurveOptions() if options is None else options
    traces = [
        _curve(one, options.styles.get(one.name) or LineStyle.of(number), options.has_markers)
        for number, one in enumerate(panel.curves)
    ]
    layout = _layout(panel.x_label, panel.y_label)
    layout["hovermode"] = "x unified" if len(traces) <= _MAX_UNIFIED else "closest"
    x_axis, y_axis = layout["xaxis"], layout["yaxis"]
    if panel.x_limits is not None:
        x_axis["range"] = list(panel.x_limits)
    if panel.y_limits is not None:
        y_axis["range"] = list(panel.y_limits)
    elif not options.has_equal_axes:
        y_axis["rangemode"] = "tozero"
    if options.has_equal_axes:
        y_axis["scaleanchor"], layout["hovermode"] = "x", "closest"
    if options.limits:
        _add_limits(layout, options.limits)
    layout["meta"] = {"has_cursor": options.has_cursor}
    return {"data": traces, "layout": layout}


def bars_figure(
    values: Mapping[str, Mapping[str, float | None]], x_label: str, y_label: str
) -> PlotlyFigure:
    """Return groups of vertical bars, or rows of bars where there is one series.

    Args:
        values: Values by series, then by group.
        x_label: What the groups are.
        y_label: Quantity and unit of the values.
    """
    is_single = len(values) == 1
    traces: list[PlotlyFigure] = []
    for number, (name, by_group) in enumerate(values.items()):
        groups, lengths = list(by_group), [_known(one) for one in by_group.values()]
        x, y = (lengths, groups) if is_single else (groups, lengths)
        orientation = "h" if is_single else "v"
        bars = {"type": "bar", "name": name, "x": x, "y": y, "orientation": orientation}
        traces.append({**bars, "meta": {"color": number}})
    layout = _layout(y_label, x_label) if is_single else _layout(x_label, y_label)
    layout |= {"barmode": "group", "showlegend": not is_single}
    layout["yaxis" if is_single else "xaxis"] |= {"automargin": True, "type": "category"}
    if is_single:
        rows = len(next(iter(values.values())))
        layout["height"] = max(_HEIGHT_PX // 2, 28 * rows + 90)
        layout["yaxis"]["autorange"] = "reversed"
    return {"data": traces, "layout": layout}


def matrix_figure(names: Sequence[str], values: Float64, label: str) -> PlotlyFigure:
    """Return a square matrix of counts with its numbers.

    Args:
        names: (K,) names of the rows and columns.
        values: (K, K) counts.
        label: What the counts are.
    """
    trace = {
        "type": "heatmap",
        "x": list(names),
        "y": list(names),
        "z": values.tolist(),
        "texttemplate": "%{z}",
        "hovertemplate": "%{y} and %{x}: %{z}<extra></extra>",
        "showscale": False,
        "zmin": 0,
        "meta": {"is_matrix": True},
    }
    layout = _layout(label, "")
    layout["yaxis"] |= {"autorange": "reversed", "automargin": True}
    return {"data": [trace], "layout": layout}


def _curve(curve: Curve, style: LineStyle, has_markers: bool) -> PlotlyFigure:
    x, y = np.asarray(curve.x, np.float64), np.asarray(curve.y, np.float64)
    step = -(-len(x) // _MAX_POINTS) if len(x) else 1
    known = np.flatnonzero(np.isfinite(y))
    # Single values among unknown ones have no line.
    is_sparse = len(known) < 2 or bool((np.diff(known) > 1).all())
    line: dict[str, Any] = {"width": 3 if curve.is_emphasised else 2}
    if style.is_dashed:
        line["dash"] = "dash"
    return {
        "type": "scatter",
        "name": curve.label,
        "mode": "lines+markers" if has_markers or is_sparse else "lines",
        "x": numbers(x[::step], 4),
        "y": numbers(y[::step], 5),
        "line": line,
        "meta": {"color": style.color},
    }


def _layout(x_label: str, y_label: str) -> PlotlyFigure:
    return {
        "height": _HEIGHT_PX,
        "margin": dict(_MARGIN_PX),
        "xaxis": {"title": {"text": x_label}, "zeroline": False},
        "yaxis": {"title": {"text": y_label}, "zeroline": False},
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        "showlegend": True,
    }


def _add_limits(layout: PlotlyFigure, limits: Mapping[str, float]) -> None:
    """Draw horizontal lines over the width of the figure, each with its name."""
    layout["shapes"] = [
        {
            "type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": value, "y1": value,
            "line": {"width": 2, "dash": "dot"}, "name": name,
        }
        for name, value in limits.items()
    ]  # fmt: skip
    layout["annotations"] = [
        {
            "text": name, "xref": "paper", "x": 1, "xanchor": "right", "y": value,
            "yanchor": "bottom", "showarrow": False,
        }
        for name, value in limits.items()
    ]  # fmt: skip


def _known(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(f"{value:.6g}")
