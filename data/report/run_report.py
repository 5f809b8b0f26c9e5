"""The report of one run."""

from collections.abc import Container, Mapping, Sequence
from typing import Any

import numpy as np

from data.report.frame_images import read_frame_images
from data.report.markup import (
    Plots,
    Section,
    Tile,
    note_markup,
    number_text,
    report_table_markup,
    table_markup,
    text_markup,
    tiles_markup,
)
from data.report.page import Page
from data.report.player import Cell, Player, PlayerFrame
from data.report.plotly_figures import CurveOptions, curves_figure, matrix_figure
from data.report.run_data import ObjectPath, RunData
from data.results.objects import ObjectRecord
from data.results.run_folder import FindingRecord, FrameRecord
from perception.detection.config import DetectionConfig
from perception.evaluation.stage_times import END_TO_END, stage_table
from perception.render.curve_plots import Curve, CurvePanel, precision_panel
from perception.types import DETECTOR_MODALITIES, HealthLevel, Progress

MODALITY_NAMES = {
    "rgb": "image",
    "dm": "depth map",
    "rm": "reflectance map",
    "bev": "from above",
}
COLUMNS = ("object", "id", "speed [m/s]", "distance [m]", "score")
FRAME = "frame"
_NO_IMAGES = "No images: the run left neither a video nor panels."
_MAX_PATHS = 20  # objects in a figure
_MIN_PATH_FRAMES = 3
_MAX_ROWS = 200  # of a table
_MAX_OBJECTS = 30  # of a frame


def run_page(run: RunData, progress: Progress = iter) -> Page:
    """Return the report of a run.

    Args:
        run: Results of the run.
        progress: Progress bar around the rows of its video.

    Raises:
        ImageError: The video is damaged.
    """
    plots = Plots()
    images = read_frame_images(run.path, run.facts.panels, len(run.frames), progress=progress)
    player = Player(images, player_frames(run, images.images), COLUMNS, 1 / run.period_s)
    data = {"frames": player.data()} if player.played else {}
    sections = [
        Section("Summary", tiles_markup(summary_tiles(run))),
        Section(
            "Drive", player.markup() + _path_markup(run, plots) if data else note_markup(_NO_IMAGES)
        ),
        Section("Tracks", _tracks_markup(run, plots)),
        *_ground_sections(run, plots),
        *_detection_sections(run, plots),
        Section("Timings", _timings_markup(run, plots)),
        Section("Health", _health_markup(run, plots)),
        Section("Configuration", text_markup("config.yaml", run.config or "missing")),
        Section("Versions", versions_markup({"": run})),
    ]
    seconds = number_text(float(run.times_s[-1]), ".1f", "s")
    subtitle = f"{len(run.frames)} frames, {seconds}, {run.summary.get('sensor', 'LiDAR')}"
    return Page(f"Run of {run.name}", subtitle, sections, plots, data)


def summary_tiles(run: RunData) -> list[Tile]:
    """Return the most important values of a run."""
    times = run.summary.get("stages_ms", {}).get(END_TO_END, {})
    p50, period_ms = times.get("p50"), 1e3 * run.period_s
    seconds = float(run.times_s[-1])
    mean_m_s = run.travelled_m / seconds if seconds > 0 else None
    tracks = run.summary.get("tracks", {})
    tiles = [
        Tile("Frames", str(len(run.frames)), number_text(seconds, ".1f", "s")),
        Tile("Path", number_text(run.travelled_m, ".0f", "m"), number_text(mean_m_s, ".1f", "m/s")),
        Tile(
            "End to end, p50",
            number_text(p50, ".1f", "ms"),
            f"p99 {number_text(times.get('p99'), '.1f', 'ms')}, period {period_ms:.0f} ms",
            is_bad=p50 is not None and p50 > period_ms,
        ),
        Tile(
            "Tracks", str(tracks.get("ids", "-")), f"{number_text(tracks.get('per_frame'))}/frame"
        ),
    ]
    if (vehicles := run.summary.get("vehicles")) is not None:
        note = f"{number_text(vehicles['per_frame'])}/frame"
        tiles.append(Tile("Vehicles", str(vehicles["ids"]), note))
    if (error_m := run.ground_error_m) is not None:
        tiles.append(Tile("Ground error", number_text(100 * error_m, ".1f", "cm"), "mDE at labels"))
    tiles += [
        Tile(f"F1 {name}", number_text(counts.get("f1"), ".3f"), "points, exact truth")
        for name, counts in (run.summary.get("points_against_truth") or {}).items()
    ]
    return tiles


def player_frames(run: RunData, played: Container[int] = ()) -> list[PlayerFrame]:
    """Return the frames of a run, those of the played rows with their objects, the nearest first."""
    return [
        PlayerFrame(
            row, one.frame, time_s, _object_rows(run.objects(one.frame)) if row in played else []
        )
        for row, (one, time_s) in enumerate(zip(run.frames, run.times_s.tolist(), strict=True))
    ]


def speeds_panel(paths: Sequence[ObjectPath]) -> CurvePanel:
    """Return the speed of objects over the frames."""
    curves = [Curve(object_name(one), one.frames, one.speeds_m_s) for one in paths]
    return CurvePanel("Speed over the ground", FRAME, "speed [m/s]", curves)


def shown_paths(run: RunData) -> list[ObjectPath]:
    """Return the objects that figures show: those of the most frames."""
    return [one for one in run.paths if len(one.frames) >= _MIN_PATH_FRAMES][:_MAX_PATHS]


def object_name(path: ObjectPath) -> str:
    """Return class and id of an object."""
    return f"{path.type or 'Object'} {path.id}"


def times_panel(run: RunData) -> CurvePanel:
    """Return the times of the stages and of the whole frame over the frames."""
    curves = [Curve(name, run.frame_numbers, ms) for name, ms in run.stages_ms.items()]
    whole = Curve(END_TO_END, run.frame_numbers, run.frames_ms, is_emphasised=True)
    shown = [whole, *curves] if np.isfinite(run.frames_ms).any() else curves
    return CurvePanel("Times of the stages", FRAME, "time [ms]", shown)


def versions_markup(runs: Mapping[str, RunData]) -> str:
    """Return the versions and machines of runs by their names."""
    names = dict.fromkeys(name for run in runs.values() for name in run.facts.versions)
    rows = [[name, *(run.facts.versions.get(name, "-") for run in runs.values())] for name in names]
    rows.append(["machine", *(run.facts.machine or "-" for run in runs.values())])
    if not names:
        return note_markup("This run states no versions: it left no report.json.")
    return table_markup("Program and packages of the run", ["", *runs], rows)


def _object_rows(objects: Sequence[ObjectRecord]) -> list[list[Cell]]:
    rows = sorted(((_distance_m(one), one) for one in objects), key=lambda row: row[0])
    return [
        [
            one.type or "Object",
            one.id,
            number_text(one.speed_m_s, ".1f"),
            number_text(distance_m, ".1f"),
            number_text(one.score, ".2f"),
        ]
        for distance_m, one in rows[:_MAX_OBJECTS]
    ]


def _distance_m(one: ObjectRecord) -> float:
    x, y, _ = one.velo.position_m
    return float("inf") if x is None or y is None else float(np.hypot(x, y))


def _path_markup(run: RunData, plots: Plots) -> str:
    start = run.poses[0, :2, 3]
    x, y = (run.poses[:, :2, 3] - start).T
    curves = [Curve("vehicle", x, y, is_emphasised=True)]
    curves += [Curve(object_name(one), *(one.positions_m - start).T) for one in shown_paths(run)]
    panel = CurvePanel("Paths from above", "x [m]", "y [m]", curves)
    return plots.add(panel.title, curves_figure(panel, CurveOptions(has_equal_axes=True)))


def _tracks_markup(run: RunData, plots: Plots) -> str:
    paths = shown_paths(run)
    if not paths:
        return note_markup("No object was tracked with a velocity.")
    note = ""
    if len(paths) < len(run.paths):
        note = f"{len(paths)} of {len(run.paths)} objects, those of the most frames."
    panel = speeds_panel(paths)
    figure = plots.add(panel.title, curves_figure(panel, CurveOptions(has_cursor=True)), note)
    rows = [
        [
            object_name(one),
            f"{one.frames[0]:.0f} to {one.frames[-1]:.0f}",
            str(len(one.frames)),
            number_text(float(np.median(one.speeds_m_s)), ".1f"),
            number_text(float(one.speeds_m_s.max()), ".1f"),
            number_text(float(np.linalg.norm(np.ptp(one.positions_m, axis=0))), ".1f"),
        ]
        for one in run.paths[:_MAX_ROWS]
    ]
    header = ["object", "frames", "tracked", "speed p50 [m/s]", "max [m/s]", "extent of path [m]"]
    table = table_markup("Tracked objects", header, rows)
    return f"{figure}<details><summary>All tracked objects</summary>{table}</details>"


def ground_panel(run: RunData) -> CurvePanel:
    """Return the error of the ground over the frames."""
    errors, frames = run.facts.ground, [float(one.frame) for one in run.facts.ground]
    values = {"mean": [one.mean_m for one in errors], "maximum": [one.max_m for one in errors]}
    curves = [
        Curve(name, frames, [np.nan if one is None else 100 * one for one in of_kind])
        for name, of_kind in values.items()
    ]
    return CurvePanel("Ground at labelled objects", FRAME, "error [cm]", curves)


def _ground_sections(run: RunData, plots: Plots) -> list[Section]:
    if run.ground_error_m is None:
        return []
    panel = ground_panel(run)
    note = (
        "Distance of the bottom centres of labelled boxes from the estimated ground, in frames that have any within the "
        "local area."
    )
    figure = curves_figure(panel, CurveOptions(has_cursor=True))
    return [Section("Ground", plots.add(panel.title, figure, note))]


def _detection_sections(run: RunData, plots: Plots) -> list[Section]:
    figures = []
    for one in run.facts.precision:
        curves = {name: np.array(values) for name, values in one.curves.items()}
        panel = precision_panel(one.title, curves)
        figures.append(plots.add(f"Precision-recall: {one.title}", curves_figure(panel)))
    if run.vehicles:
        counts = _agreement(run)
        used = np.flatnonzero(counts.diagonal())
        names = [MODALITY_NAMES[DETECTOR_MODALITIES[one]] for one in used]
        note = (
            "Listed vehicles with a fused score of at least "
            f"{DetectionConfig.display_score:g} that both detectors found; the diagonal counts all of one detector."
        )
        figure = matrix_figure(names, counts[np.ix_(used, used)], "")
        figures.append(plots.add("Vehicles found by each pair of detectors", figure, note))
    return [Section("Detection", f'<div class="plots">{"".join(figures)}</div>')] if figures else []


def _agreement(run: RunData) -> np.ndarray[Any, Any]:
    """Return the (4, 4) number of vehicles that two modalities found together."""
    found_by = [
        [one.scores.get(name) is not None for name in DETECTOR_MODALITIES]
        for frame in run.vehicles.values()
        for one in frame.vehicles
        if (one.score or 0.0) >= DetectionConfig.display_score
    ]
    found = np.array(found_by, np.int64).reshape(-1, len(DETECTOR_MODALITIES))
    return np.asarray(found.T @ found)


def _timings_markup(run: RunData, plots: Plots) -> str:
    panel = times_panel(run)
    options = CurveOptions({"period of the sensor": 1e3 * run.period_s}, has_cursor=True)
    table = stage_table(
        "Times of the stages", {n: (ms / 1e3).tolist() for n, ms in run.stages_ms.items()}
    )
    return plots.add(panel.title, curves_figure(panel, options)) + report_table_markup(table)


def health_panel(run: RunData) -> CurvePanel | None:
    """Return the level of each part over the frames, None where all parts were well all the time."""
    parts = sorted({one.part for frame in run.frames for one in frame.health})
    curves = [
        Curve(
            part,
            run.frame_numbers,
            [
                max(
                    (int(HealthLevel[one.level]) for one in frame.health if one.part == part),
                    default=0,
                )
                for frame in run.frames
            ],
        )
        for part in parts
    ]
    label = "0 OK, 1 WARN, 2 ERROR"
    return (
        CurvePanel("Sensors and stages", FRAME, label, curves, y_limits=(-0.1, 2.1))
        if curves
        else None
    )


def _faults_markup(run: RunData, plots: Plots) -> str:
    """Return the health of sensors and stages over the frames, and what was found first of each fault."""
    panel = health_panel(run)
    if panel is None:
        return note_markup("Sensors and stages: OK in all frames.")
    first: dict[str, tuple[FrameRecord, FindingRecord]] = {}
    counts: dict[str, int] = {}
    for frame in run.frames:
        for one in frame.health:
            first.setdefault(one.fault, (frame, one))
            counts[one.fault] = counts.get(one.fault, 0) + 1
    rows = [
        [fault, one.part, one.level, str(counts[fault]), str(frame.frame), one.reason]
        for fault, (frame, one) in first.items()
    ]
    header = ["fault", "part", "level", "frames", "first", "what was found first"]
    figure = plots.add(panel.title, curves_figure(panel, CurveOptions(has_cursor=True)))
    return figure + table_markup("Faults", header, rows)


def _health_markup(run: RunData, plots: Plots) -> str:
    missing = int(run.frame_numbers[-1] - run.frame_numbers[0]) + 1 - len(run.frames)
    invalid = sum(one.invalid_points for one in run.frames)
    skipped = run.facts.skipped
    tiles = [
        Tile("Bad frames", str(missing), "left out of the results", is_bad=missing > 0),
        Tile("Skipped stages", str(sum(skipped.values())), "to keep the time budget"),
        Tile("Invalid points", str(invalid), "NaN, infinity or beyond 10 km"),
    ]
    rows = [[stage, str(count)] for stage, count in skipped.items()]
    table = table_markup("Skipped stages", ["stage", "frames"], rows) if rows else ""
    return tiles_markup(tiles) + table + _faults_markup(run, plots)
