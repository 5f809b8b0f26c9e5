"""Challenges of tracking one object, one at a time and all together, on scenes with exact truth."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from benchmarks.studies.report import RESULTS, publish
from perception.cli.parser import FlagGroup
from perception.cli.progress import progress_bar
from perception.evaluation.config import MIN_OVERLAP
from perception.evaluation.report import Column, Table
from perception.render.curve_plots import CurvePanel, plot_curves, tracking_error_panel
from perception.sensor import load_sensor
from perception.tracking.single_object.config import SingleObjectTrackerConfig
from perception.types import Float64

if TYPE_CHECKING:
    from data.synthetic.scenarios import ScenarioDrive
    from perception.evaluation.single_object.metrics import SingleObjectErrors, SingleObjectMetrics
    from perception.evaluation.single_object.track import TargetObject, TrueTrack

# An object that was hidden is reacquired once it is observed with this overlap of both boxes (A.1).
_REACQUIRED_IOU = MIN_OVERLAP


@dataclass(frozen=True)
class SingleObjectStudyConfig(FlagGroup):
    """Scenes and trackers.

    Attributes:
        trackers: Names of the trackers, the first of them emphasised in the figure.
        object_class: Class of the object.
        duration_s: Duration of each scene in seconds; its events are stretched with it.
        seed: Seed of the street, of appearances and of noise.
    """

    trackers: tuple[str, ...] = ("default", "h-fus", "l-fus", "3d-ms", "3d-kf")
    object_class: Literal["Car", "Cyclist", "Pedestrian"] = "Car"
    duration_s: float = 6.0
    seed: int = 0


@dataclass(frozen=True)
class SingleObjectStudyMetrics:
    """Metrics of one tracker in one scene.

    Attributes:
        scores: Metrics over all frames.
        reacquired_s: Seconds from the end of the occlusion until the tracker has the object again;
            infinite where it never has, NaN where the object was never hidden.
        refusal: Reason why the tracker could not begin, or None.
    """

    scores: "SingleObjectMetrics"
    reacquired_s: float
    refusal: str | None = None


def single_object(
    *,
    config: SingleObjectStudyConfig,
    sensor: str = "HDL-64E",
    out: Path = RESULTS / "single-object.png",
) -> None:
    """Measure trackers of one object under occlusion, turns, changes of speed, and changes of light.

    Example: trifuse study single-object --object-class Cyclist --trackers default,h-fus,opencv-kcf

    Args:
        sensor: LiDAR model, such as HDL-64E, VLP-16 or OS1-64, or a .yaml or .json file that describes one.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from data.derived.otd_objects import run_trackers
    from data.synthetic import scenarios
    from perception.evaluation.single_object.metrics import (
        single_object_errors,
        single_object_metrics,
    )
    from perception.evaluation.single_object.tracker_runs import named_trackers, require_trackers

    require_trackers(config.trackers)
    model, panels = load_sensor(sensor), []
    rows: dict[str, SingleObjectStudyMetrics] = {}
    for scenario in scenarios.all_scenarios(config.object_class, config.duration_s):
        drive = scenarios.ScenarioDrive(scenario, seed=config.seed, sensor=model)
        target = target_of(drive)
        truth, frames = target.truth, len(drive)
        makers = named_trackers(config.trackers, model, SingleObjectTrackerConfig())
        (runs,) = run_trackers(drive, [target], makers, progress=progress_bar)
        errors = {
            name: single_object_errors(truth, run.track, drive.calibration)
            for name, run in runs.items()
        }
        for name, run in runs.items():
            rows[f"{scenario.name}: {name}"] = SingleObjectStudyMetrics(
                single_object_metrics(errors[name]),
                reacquisition_time_s(truth, errors[name]),
                run.refusal,
            )
        panels.append(_error_panel(scenario.name, truth, errors))
    subject = f"a {config.object_class.lower()} by {model.name}"
    plot_curves(out, f"Tracking {subject}: centre error", panels, columns=4, share_y="all")
    publish(
        out,
        "the challenges of Table 3.2 and A.1, on scenes with exact truth",
        {"trackers": _table(f"tracking {subject}, {frames} frames per scene", rows)},
        {"config": config, "sensor": model, "reacquired_iou": _REACQUIRED_IOU},
    )


def target_of(drive: "ScenarioDrive") -> "TargetObject":
    """Return the object of a scene, to be tracked in all its frames."""
    from data.synthetic.scenarios import TARGET_ID, true_track
    from perception.evaluation.single_object.track import ObjectSequence, TargetObject

    scenario, frames = drive.scenario, len(drive)
    sequence = ObjectSequence(scenario.name, drive.name, TARGET_ID, scenario.kind, 0, frames - 1)
    return TargetObject(sequence, true_track(drive), frames)


def _error_panel(
    title: str, truth: "TrueTrack", errors: Mapping[str, "SingleObjectErrors"]
) -> CurvePanel:
    """Return the centre errors of the trackers with 3D boxes, NaN where a frame has none."""
    errors_m = {}
    for name, one in errors.items():
        if one.has_3d_boxes:
            errors_m[name] = np.full(len(truth.stamps_s), np.nan)
            errors_m[name][np.isin(truth.frames, one.frames)] = one.center_m
    return tracking_error_panel(title, truth.stamps_s, np.isnan(truth.boxes_px[:, 0]), errors_m)


def reacquisition_time_s(truth: "TrueTrack", errors: "SingleObjectErrors") -> float:
    """Return the seconds from the last hidden frame to the first in which the object is reacquired.

    Reacquired means that the tracker observes it and overlaps it enough, in 3D or else in the image.
    """
    from perception.tracking.single_object.tracker import TrackStatus

    hidden = np.flatnonzero(np.isnan(truth.boxes_px[:, 0]))
    if not len(hidden):
        return np.nan
    last_s = truth.stamps_s[hidden[-1]]
    overlap = errors.overlap if errors.has_3d_boxes else errors.overlap_px
    stamps_s: Float64 = truth.stamps_s[np.isin(truth.frames, errors.frames)]
    is_observed = (errors.states == TrackStatus.SEEN) & (stamps_s > last_s)
    is_found = is_observed & (overlap > _REACQUIRED_IOU)
    return float(stamps_s[is_found][0] - last_s) if is_found.any() else np.inf


_COLUMNS: list[Column[SingleObjectStudyMetrics]] = [
    Column("E3D [m]", lambda m: m.scores.center_m, ".2f", "center_m"),
    Column("E2D [px]", lambda m: m.scores.center_px, ".1f", "center_px"),
    Column("heading [deg]", lambda m: np.degrees(m.scores.heading_rad), ".1f", "heading_deg"),
    Column("observed [%]", lambda m: m.scores.seen, ".0%", "observed"),
    Column("predicted [%]", lambda m: m.scores.predicted, ".0%", "predicted"),
    Column("lost [%]", lambda m: m.scores.lost, ".0%", "lost"),
    Column("drifted [%]", lambda m: m.scores.drifted, ".0%", "drifted"),
    Column("reacquired [s]", lambda m: m.reacquired_s, ".1f", "reacquired_s"),
    Column("time [ms/frame]", lambda m: m.scores.ms_per_frame, ".1f", "ms_per_frame"),
]


def _table(
    title: str, rows: Mapping[str, SingleObjectStudyMetrics]
) -> Table[SingleObjectStudyMetrics]:
    measured = {name: row for name, row in rows.items() if row.refusal is None}
    notes = (
        "Errors are means over all frames, hidden ones included. reacquired: time from the end of the "
        f"occlusion until observed with an overlap over {_REACQUIRED_IOU:g}; inf: never.",
        *(f"{name}: {row.refusal}" for name, row in rows.items() if row.refusal is not None),
    )
    return Table(title, _COLUMNS, measured, "scene: tracker", notes)
