"""A JSON report of any command as tables and figures: metrics by row, precision-recall curves, reliability, times."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from data.report.markup import Plots, note_markup, table_markup
from data.report.plotly_figures import CurveOptions, bars_figure, curves_figure
from perception.render.curve_plots import Curve, CurvePanel, precision_panel

Document = Mapping[str, Any]
Scalar = str | int | float | bool | None

_UNITS = {
    "m": "m", "ms": "ms", "s": "s", "px": "px", "percent": "%", "deg": "deg", "rad": "rad", "hz": "Hz", "mib": "MiB", "gb": "GB",
}  # fmt: skip
_CURVE, _RELIABILITY, _TIME = "curve", {"scores", "shares", "counts"}, "relative_time"
# Sections that lead to curves: those of methods beside each other, those that only group, those of details.
_METHODS, _LEVEL, _UNNAMED = "rows", "moderate", ("rows", "classes")
_DETAILS = ("benchmark", "steps", "missing_modalities")
_AVERAGE = re.compile(r"ap_r\d+_percent")
_MAX_TABLES = 40
_MAX_LIST = 12  # longer lists of numbers are no text


def document_markup(title: str, document: Document, plots: Plots) -> str:
    """Return everything that a document holds: its values, those of each section, and figures.

    Args:
        title: Name of the document.
        document: Values and sections, nested to any depth.
        plots: Figures of the page, to which those of the document are added.
    """
    values = _values(document)
    own = values_markup(title, values) if values else ""
    tables = list(_sections_markup(title, document))
    shown = own + "".join(tables[:_MAX_TABLES])
    if len(tables) > _MAX_TABLES:
        shown += note_markup(f"{len(tables) - _MAX_TABLES} more tables are in the JSON document.")
    return figures_markup(title, document, plots) + shown


def figures_markup(title: str, document: Document, plots: Plots) -> str:
    """Return the figures of what a document holds: precision and recall, paths, reliability, relative times."""
    found = [
        *_precision_plots(document, plots),
        *_path_plots(document, plots),
        *_section_plots(title, document, plots),
    ]
    return f'<div class="plots">{"".join(found)}</div>' if found else ""


def values_markup(title: str, values: Mapping[str, Scalar]) -> str:
    """Return values with their names as a table."""
    rows = [[heading(name), cell(value)] for name, value in values.items()]
    return table_markup(title, ["", "value"], rows)


def heading(key: str) -> str:
    """Return a key in words with its unit: `mde_m` as `mde [m]`."""
    words = key.replace("/", " ").split("_")
    if len(words) > 1 and words[-1] in _UNITS:
        return f"{' '.join(words[:-1])} [{_UNITS[words[-1]]}]"
    return " ".join(words)


def cell(value: object) -> str:
    """Return a value as text: numbers to four digits, a dash for none."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) < 1e5 else f"{value:.0f}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(cell, value))
    return str(value)


def _sections_markup(title: str, document: Document) -> Iterator[str]:
    sections = _sections(document)
    yield from _tables_markup(title, sections)
    for name, one in sections.items():
        yield from _sections_markup(f"{title}, {heading(name)}", one)


def _section_plots(title: str, document: Document, plots: Plots) -> Iterator[str]:
    sections = _sections(document)
    reliable = {name: one for name, one in sections.items() if set(one) >= _RELIABILITY}
    if reliable:
        yield plots.add(f"Reliability: {title}", _reliability(reliable))
    times = {name: one[_TIME] for name, one in sections.items() if _TIME in one}
    if times:
        yield plots.add(f"Relative time: {title}", bars_figure({title: times}, "", "relative time"))
    for name, one in sections.items():
        yield from _section_plots(f"{title}, {heading(name)}", one, plots)


def _sections(document: Document) -> dict[str, Document]:
    return {
        str(name): one
        for name, one in document.items()
        if isinstance(one, Mapping) and name != _CURVE
    }


def _tables_markup(title: str, sections: Mapping[str, Document]) -> Iterator[str]:
    """Yield a table for all sections whose values have the same names."""
    tables: dict[tuple[str, ...], dict[str, dict[str, Scalar]]] = {}
    for name, one in sections.items():
        if values := _values(one):
            tables.setdefault(tuple(values), {})[name] = values
    for keys, rows in tables.items():
        if len(rows) == 1 and len(sections) > 1:
            (name,) = rows
            yield values_markup(f"{title}, {heading(name)}", rows[name])
        else:
            cells = [[heading(n), *(cell(row[key]) for key in keys)] for n, row in rows.items()]
            yield table_markup(title, ["", *map(heading, keys)], cells)


def _values(document: Document) -> dict[str, Scalar]:
    """Return the values of a section that are neither sections nor long lists."""
    return {
        str(name): value
        for name, value in document.items()
        if not isinstance(value, Mapping) and not _is_long(value)
    }


def _is_long(value: object) -> bool:
    if not isinstance(value, list):
        return False
    return len(value) > _MAX_LIST or any(isinstance(one, list | dict) for one in value)


def _precision_plots(document: Document, plots: Plots) -> Iterator[str]:
    """Yield a figure for each class and IoU: its difficulties, or where there are several methods these at moderate."""
    panels: dict[tuple[str, ...], dict[str, Any]] = {}
    for path, section in _curves(document):
        *place, level = path
        if _METHODS in place:
            method = place.pop(place.index(_METHODS) + 1)
            if level != _LEVEL:
                continue
            place, level = [*place, level], method
        averages = [value for key, value in section.items() if _AVERAGE.fullmatch(key)]
        note = f": {averages[0]:.1f} %" if averages and averages[0] is not None else ""
        panels.setdefault(tuple(place), {})[f"{level}{note}"] = np.array(
            section[_CURVE]["precision"]
        )
    for names, curves in panels.items():
        title = ", ".join(heading(name) for name in names if name not in _UNNAMED)
        figure = curves_figure(precision_panel(title, curves))
        yield plots.add(f"Precision-recall: {title}", figure)


def _path_plots(document: Document, plots: Plots) -> Iterator[str]:
    """Yield a figure of the paths from above."""
    if paths := document.get("paths"):
        curves = [Curve(name, one["x_m"], one["y_m"]) for name, one in paths.items()]
        panel = CurvePanel("Path", "x [m]", "y [m]", curves)
        yield plots.add("Path", curves_figure(panel))


def _curves(document: Document, path: tuple[str, ...] = ()) -> Iterator[tuple[list[str], Document]]:
    """Yield the sections that hold a curve, with the names that lead to them."""
    for name, section in _sections(document).items():
        curve = section.get(_CURVE)
        if isinstance(curve, Mapping) and "precision" in curve:
            yield [*path, name], section
        elif name not in _DETAILS:
            yield from _curves(section, (*path, name))


def _reliability(found: Mapping[str, Document]) -> dict[str, Any]:
    curves = [Curve(name, one["scores"], one["shares"]) for name, one in found.items()]
    ideal = Curve("calibrated", [0.0, 1.0], [0.0, 1.0])
    panel = CurvePanel(
        "Reliability", "mean score", "share of correct detections", [*curves, ideal],
        x_limits=(0, 1), y_limits=(0, 1.02),
    )  # fmt: skip
    return curves_figure(panel, CurveOptions(has_markers=True))
