"""The report of a batch: every drive with its errors and numbers, the worst first, and how the numbers spread."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from data.label_proposals.review_page import PAGE_NAME
from data.report.markup import (
    Plots,
    Section,
    Tile,
    note_markup,
    number_text,
    table_markup,
    tiles_markup,
)
from data.report.page import Page
from data.report.plotly_figures import CurveOptions, bars_figure, curves_figure
from data.results.folder import DRIVES
from data.results.records import read_json_lines
from perception.render.curve_plots import Curve, CurvePanel

Row = Mapping[str, Any]

_OWN = ("name", "state", "frames", "seconds", "key", "error")
_MAX_FIGURES = 12
_MAX_BARS = 40  # drives; more are shown as a curve of sorted values
_MAX_ROWS = 200


def fleet_page(folder: Path) -> Page:
    """Return the report of a batch.

    Raises:
        LabelError: Its rows cannot be read.
    """
    rows = read_json_lines(folder / DRIVES)
    plots = Plots()
    sections = [Section("Summary", _summary_markup(rows))]
    if failed := [row for row in rows if row["state"] == "failed"]:
        cells = [(str(row["name"]), str(row["error"])) for row in failed[:_MAX_ROWS]]
        more = len(failed) - len(cells)
        note = note_markup(f"and {more} more") if more else ""
        sections.append(
            Section("Failed", table_markup("Failed drives", ("drive", "error"), cells) + note)
        )
    numbers = _varying(rows)
    if figures := "".join(_figure(name, rows, plots) for name in numbers[:_MAX_FIGURES]):
        sections.append(Section("Numbers", figures))
    sections.append(Section("Drives", _drives_markup(folder, rows, numbers)))
    return Page("Batch", str(folder), sections, plots)


def _summary_markup(rows: Sequence[Row]) -> str:
    count = {
        state: sum(row["state"] == state for row in rows) for state in ("done", "skipped", "failed")
    }
    seconds, frames = (sum(row[name] for row in rows) for name in ("seconds", "frames"))
    tiles = [
        Tile("drives", str(len(rows))),
        Tile("done", str(count["done"] + count["skipped"]), f"{count['skipped']} of them before"),
        Tile("failed", str(count["failed"]), is_bad=count["failed"] > 0),
        Tile("frames", str(int(frames))),
        Tile("time of workers", number_text(seconds / 3600, ".2f", "h")),
    ]
    return tiles_markup(tiles)


def _varying(rows: Sequence[Row]) -> list[str]:
    """Return the names of the numbers that differ between drives; times of single stages come last."""
    names = dict.fromkeys(name for row in rows for name in row if name not in _OWN)
    varying = [name for name in names if len({row.get(name) for row in rows} - {None}) > 1]
    of_stages = [
        name for name in varying if name.startswith("stages_ms.") and ".end to end." not in name
    ]
    return ["seconds", *(name for name in varying if name not in of_stages), *of_stages]


def _figure(name: str, rows: Sequence[Row], plots: Plots) -> str:
    values = {str(row["name"]): row[name] for row in rows if row.get(name) is not None}
    ranked = dict(sorted(values.items(), key=lambda one: -one[1]))
    if len(ranked) <= _MAX_BARS:
        return plots.add(name, bars_figure({name: ranked}, "drive", name))
    curve = Curve(name, list(range(1, len(ranked) + 1)), list(ranked.values()))
    panel = CurvePanel(name, "drives, the largest value first", name, [curve])
    return plots.add(name, curves_figure(panel, CurveOptions()))


def _drives_markup(folder: Path, rows: Sequence[Row], numbers: Sequence[str]) -> str:
    """Return the drives with links to their own reports, or pages of a review: failed ones, then those with most faulty frames."""
    ranked = sorted(rows, key=_worst_first)
    shown, columns = ranked[:_MAX_ROWS], [name for name in numbers if name != "seconds"][:6]
    cells = [
        (
            str(row["name"]), row["state"], str(int(row["frames"])),
            number_text(_faulty_percent(row), ".1f", "%"), number_text(row["seconds"]),
            *(number_text(row.get(name), ".4g") for name in columns),
        )
        for row in shown
    ]  # fmt: skip
    links = {
        str(row["name"]): place
        for row in shown
        for page in (PAGE_NAME, "report.html")
        if (folder / (place := f"drives/{row['name']}/{page}")).is_file()
    }
    header = ("drive", "state", "frames", "faulty frames", "seconds", *columns)
    more = len(rows) - len(shown)
    note = note_markup(f"and {more} more: see {DRIVES}") if more else ""
    return table_markup("Drives", header, cells, links) + note


def _worst_first(row: Row) -> tuple[Any, ...]:
    """Return what drives are sorted by; of those that are equally faulty the slowest come first."""
    is_fine = row["state"] != "failed"
    return is_fine, -(_faulty_percent(row) or 0.0), -row["seconds"], row["name"]


def _faulty_percent(row: Row) -> float | None:
    """Return the share of frames with a finding of a monitor, in percent; None where none watched."""
    frames, healthy = row.get("health.frames"), row.get("health.healthy")
    return None if not frames or healthy is None else 100 * (1 - healthy / frames)
