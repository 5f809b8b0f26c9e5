"""The report of two runs beside each other."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import unified_diff
from typing import TypeVar

from data.report.frame_images import MAX_IMAGE_BYTES, FrameImages, read_frame_images
from data.report.markup import Plots, Section, note_markup, number_text, table_markup, text_markup
from data.report.page import Page
from data.report.player import Player, PlayerFrame
from data.report.plotly_figures import CurveOptions, LineStyle, bars_figure, curves_figure
from data.report.run_data import RunData
from data.report.run_report import (
    ground_panel,
    player_frames,
    shown_paths,
    speeds_panel,
    times_panel,
    versions_markup,
)
from perception.evaluation.stage_times import ALL_STAGES, END_TO_END
from perception.render.curve_plots import Curve, CurvePanel

Item = TypeVar("Item")

_SUMS = (ALL_STAGES, END_TO_END)
_PATHS = 10  # of each run in a figure
_MAX_DIFFERENCES = 200  # lines of the configurations


def comparison_page(first: RunData, second: RunData) -> Page:
    """Return two runs beside each other, those of one drive frame by frame.

    Raises:
        ImageError: A video is damaged.
    """
    plots = Plots()
    runs = dict(zip(_names(first, second), (first, second), strict=True))
    player = _player(runs)
    data = {"frames": player.data()} if player.played else {}
    is_same = first.name == second.name
    note = (
        ""
        if is_same
        else note_markup("The runs are of different drives: frames do not correspond.")
    )
    frames = player.markup() if data else note_markup("No frame has images in both runs.")
    sections = [
        Section("Summary", note + _summary_markup(runs)),
        Section("Drive", frames),
        Section("Tracks", _tracks_markup(runs, plots)),
        *_ground_sections(runs, plots),
        Section("Timings", _timings_markup(runs, plots)),
        Section("Configuration", _configuration_markup(runs)),
        Section("Versions", versions_markup(runs)),
    ]
    subtitle = f"{first.path} and {second.path}"
    title = f"Runs of {first.name}" if is_same else f"Runs of {first.name} and {second.name}"
    return Page(title, subtitle, sections, plots, data)


def _names(first: RunData, second: RunData) -> tuple[str, str]:
    """Return the names of the folders, with A and B where they are the same."""
    names = first.path.resolve().name, second.path.resolve().name
    return names if names[0] != names[1] else (f"A: {names[0]}", f"B: {names[1]}")


def _player(runs: Mapping[str, RunData]) -> Player:
    """Return the frames that both runs have, the same view of both beside each other."""
    first, second = runs.values()
    share = MAX_IMAGE_BYTES // 2
    found = [
        read_frame_images(run.path, run.facts.panels, len(run.frames), share)
        for run in runs.values()
    ]
    rows = {one.frame: row for row, one in enumerate(second.frames)}
    frames: list[PlayerFrame] = []
    images: dict[int, Sequence[bytes]] = {}
    for one in player_frames(first):
        other = rows.get(one.frame)
        frames.append(one)
        if other is not None and other in found[1].images and one.row in found[0].images:
            images[one.row] = _interleaved(found[0].images[one.row], found[1].images[other])
    titles = [
        [f"{name}: {view}" for view in of_run.views]
        for name, of_run in zip(runs, found, strict=True)
    ]
    views, sizes = _interleaved(*titles), _interleaved(found[0].sizes_px, found[1].sizes_px)
    return Player(FrameImages(views, sizes, images), frames, (), 1 / first.period_s, is_paired=True)


def _interleaved(first: Sequence[Item], second: Sequence[Item]) -> list[Item]:
    return [one for pair in zip(first, second, strict=False) for one in pair]


def _summary_markup(runs: Mapping[str, RunData]) -> str:
    first, second = (_values(run) for run in runs.values())
    rows = [
        [
            name,
            number_text(first.get(name), ".4g"),
            number_text(second.get(name), ".4g"),
            _difference(first.get(name), second.get(name)),
        ]
        for name in dict.fromkeys([*first, *second])
    ]
    return table_markup("Both runs", ["", *runs, "difference"], rows)


def _values(run: RunData) -> dict[str, float | None]:
    """Return the values of a run that are compared."""
    summary = run.summary
    times = summary.get("stages_ms", {}).get(END_TO_END, {})
    values: dict[str, float | None] = {
        "frames": len(run.frames),
        "path [m]": run.travelled_m,
        "end to end p50 [ms]": times.get("p50"),
        "end to end p99 [ms]": times.get("p99"),
        "tracks": summary.get("tracks", {}).get("ids"),
        "tracks/frame": summary.get("tracks", {}).get("per_frame"),
        "vehicles": (summary.get("vehicles") or {}).get("ids"),
        "vehicles/frame": (summary.get("vehicles") or {}).get("per_frame"),
        "ground error [cm]": None if run.ground_error_m is None else 100 * run.ground_error_m,
        "wall time [s]": summary.get("elapsed_s"),
    }
    for name, counts in (summary.get("points_against_truth") or {}).items():
        values[f"F1 {name}"] = counts.get("f1")
    return {name: value for name, value in values.items() if value is not None}


def _difference(first: float | None, second: float | None) -> str:
    if first is None or second is None:
        return "-"
    share = f" ({100 * (second - first) / abs(first):+.1f} %)" if first and second != first else ""
    return f"{second - first:+.4g}{share}"


def _overlaid(
    title: str,
    panels: Mapping[str, CurvePanel],
    plots: Plots,
    limits: Mapping[str, float] | None = None,
    note: str = "",
) -> str:
    """Return the curves of both runs in one figure, those of the second dashed and of the same colours."""
    (name_a, panel_a), (name_b, panel_b) = panels.items()
    names = list(dict.fromkeys(one.name for one in (*panel_a.curves, *panel_b.curves)))
    curves, styles = [], {}
    for run, panel in panels.items():
        for one in panel.curves:
            name = f"{one.name}, {run}"
            curves.append(replace(one, name=name))
            styles[name] = LineStyle(names.index(one.name), is_dashed=run == name_b)
    options = CurveOptions(limits or {}, has_cursor=True, styles=styles)
    figure = curves_figure(replace(panel_a, curves=curves), options)
    return plots.add(title, figure, f"Solid: {name_a}; dashed: {name_b}. {note}")


def _tracks_markup(runs: Mapping[str, RunData], plots: Plots) -> str:
    counts = {
        name: CurvePanel(
            "Tracks",
            "frame",
            "tracks",
            [Curve("tracks", run.frame_numbers, [float(one.tracks) for one in run.frames])],
        )
        for name, run in runs.items()
    }
    speeds = {name: speeds_panel(shown_paths(run)[:_PATHS]) for name, run in runs.items()}
    return _overlaid("Number of tracks", counts, plots) + _overlaid(
        "Speed over the ground", speeds, plots, note="Each run gives ids of its own."
    )


def _ground_sections(runs: Mapping[str, RunData], plots: Plots) -> list[Section]:
    if any(run.ground_error_m is None for run in runs.values()):
        return []
    panels = {name: ground_panel(run) for name, run in runs.items()}
    return [Section("Ground", _overlaid("Ground at labelled objects", panels, plots))]


def _timings_markup(runs: Mapping[str, RunData], plots: Plots) -> str:
    first = next(iter(runs.values()))
    whole = {}
    for name, run in runs.items():
        panel = times_panel(run)
        whole[name] = replace(panel, curves=[one for one in panel.curves if one.is_emphasised])
    limits = {"period of the sensor": 1e3 * first.period_s}
    medians = {
        name: {stage: times["p50"] for stage, times in run.summary.get("stages_ms", {}).items()}
        for name, run in runs.items()
    }
    of_stages = {
        name: {stage: ms for stage, ms in of_run.items() if stage not in _SUMS}
        for name, of_run in medians.items()
    }
    stages = list(dict.fromkeys(stage for of_run in medians.values() for stage in of_run))
    rows = []
    for stage in stages:
        a, b = (of_run.get(stage) for of_run in medians.values())
        rows.append([stage, number_text(a), number_text(b), _difference(a, b)])
    return (
        _overlaid("End to end", whole, plots, limits)
        + plots.add("Median time of each stage", bars_figure(of_stages, "", "p50 [ms]"))
        + table_markup("Median time of each stage in ms", ["stage", *runs, "difference"], rows)
    )


def _configuration_markup(runs: Mapping[str, RunData]) -> str:
    (name_a, first), (name_b, second) = runs.items()
    lines = first.config.splitlines(), second.config.splitlines()
    found = list(unified_diff(*lines, fromfile=name_a, tofile=name_b, lineterm="", n=1))
    if not found:
        return note_markup("Both runs have the same configuration.")
    shown = found[:_MAX_DIFFERENCES]
    return text_markup("Differences", "\n".join(shown), is_open=True)
