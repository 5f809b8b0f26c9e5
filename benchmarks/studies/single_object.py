"""What makes one object hard to follow, one difficulty at a time and all together, with exact truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.studies.report import Study
from data.derived.single_object import ObjectSequence
from data.synthetic.scenario_truth import true_track
from data.synthetic.scenarios import TARGET_ID, Scenario, ScenarioDrive, TargetClass, all_scenarios
from perception.cli.evaluations.otd_steps import TargetObject, TrackerRun, track_objects
from perception.cli.table import Cell, format_table
from perception.evaluation.config import SingleObjectMetricsConfig
from perception.evaluation.single_object.errors import SingleObjectErrors, single_object_errors
from perception.evaluation.single_object.metrics import SingleObjectMetrics, single_object_metrics
from perception.evaluation.single_object.track import TrueTrack
from perception.render.tracking_error_plots import TrackingErrorPanel, plot_tracking_errors
from perception.sensor import HDL_64E, LidarModel
from perception.tracking.single_object.tracker import TrackStatus
from perception.types import Bool, Float64

# After an object was hidden, it is found again once it is seen and so much of both boxes is shared (A.1).
_REACQUIRED_IOU = SingleObjectMetricsConfig().overlap
_COLUMNS = (
    *("scene", "tracker", "E3D m", "E2D px", "heading deg"),
    *("seen", "predicted", "lost", "beside it", "found again", "ms"),
)


@dataclass(frozen=True)
class SingleObjectStudyConfig:
    """What to measure.

    Attributes:
        trackers: names, the first of them emphasised.
        kind: KITTI's type of the object.
        duration_s: of each scene.
        seed: of the street, of looks and of noise.
        sensor: the LiDAR.
    """

    trackers: Sequence[str]
    kind: TargetClass = "Car"
    duration_s: float = 6.0
    seed: int = 0
    sensor: LidarModel = field(default_factory=lambda: HDL_64E)


@dataclass(frozen=True)
class SingleObjectStudyMetrics:
    """How one tracker did in one scene.

    Attributes:
        scores: over all frames.
        hidden_frames: in which nobody sees the object.
        reacquired_s: after the object was hidden, until the tracker has it again; infinite where it never
            has, NaN where the object was never hidden.
        refusal: why the tracker could not begin, or None.
    """

    scores: SingleObjectMetrics
    hidden_frames: int
    reacquired_s: float
    refusal: str | None = None


@dataclass(frozen=True)
class _Scene:
    """One scene and what became of it."""

    scenario: Scenario
    truth: TrueTrack
    errors: Mapping[str, SingleObjectErrors]
    metrics: Mapping[str, SingleObjectStudyMetrics]

    @property
    def is_hidden(self) -> Bool:
        """(K,) in which frames nobody sees the object."""
        return np.asarray(np.isnan(self.truth.boxes_px[:, 0]))

    def panel(self) -> TrackingErrorPanel:
        """Return what is drawn of it: the trackers that answer in space."""
        times_s, errors_m = self.truth.stamps_s, {}
        for name, errors in self.errors.items():
            if errors.has_3d_boxes:
                errors_m[name] = _at(times_s, self.truth, errors)
        return TrackingErrorPanel(self.scenario.name, times_s, self.is_hidden, errors_m)


def study_single_object(plot_path: Path, config: SingleObjectStudyConfig) -> Study:
    """Let trackers follow the same object through every scene, and draw how far off they are."""
    scenes = [_measure(one, config) for one in all_scenarios(config.kind, config.duration_s)]
    title = f"Following a {config.kind.lower()} by {config.sensor.name}: centre error over time"
    plot_tracking_errors(plot_path, title, [scene.panel() for scene in scenes])
    return Study(
        name="following",
        repeats="the challenges of Table 3.2 and A.1, on scenes with exact truth",
        table=_table(config, scenes),
        numbers={scene.scenario.name: dict(scene.metrics) for scene in scenes},
        conditions={"plan": config, "found_again_overlap": _REACQUIRED_IOU},
    )


def _measure(scenario: Scenario, config: SingleObjectStudyConfig) -> _Scene:
    drive = ScenarioDrive(scenario, seed=config.seed, sensor=config.sensor)
    truth = true_track(drive)
    last = len(drive) - 1
    sequence = ObjectSequence(scenario.name, drive.name, TARGET_ID, scenario.kind, 0, last)
    target = TargetObject(sequence, truth, len(drive))
    (followings,) = track_objects(drive, [target], config.trackers)
    errors = {
        name: single_object_errors(truth, following.track, drive.calibration)
        for name, following in followings.items()
    }
    metrics = {name: _metrics(truth, errors[name], followings[name]) for name in followings}
    return _Scene(scenario, truth, errors, metrics)


def _metrics(
    truth: TrueTrack, errors: SingleObjectErrors, following: TrackerRun
) -> SingleObjectStudyMetrics:
    hidden_frames = int(np.isnan(truth.boxes_px[:, 0]).sum())
    reacquired_s = reacquisition_time_s(truth, errors)
    return SingleObjectStudyMetrics(
        single_object_metrics(errors), hidden_frames, reacquired_s, following.refusal
    )


def reacquisition_time_s(truth: TrueTrack, errors: SingleObjectErrors) -> float:
    """Return the seconds from the last frame in which the object is hidden to the first in which it is found.

    Found is what the tracker calls seen and overlaps the object enough, in space or else in the image.
    """
    hidden = np.flatnonzero(np.isnan(truth.boxes_px[:, 0]))
    if not len(hidden):
        return np.nan
    last_s = truth.stamps_s[hidden[-1]]
    overlap = errors.overlap if errors.has_3d_boxes else errors.overlap_px
    stamps_s = truth.stamps_s[np.isin(truth.frames, errors.frames)]
    is_observed = (errors.states == TrackStatus.SEEN) & (stamps_s > last_s)
    is_found = is_observed & (overlap > _REACQUIRED_IOU)
    return float(stamps_s[is_found][0] - last_s) if is_found.any() else np.inf


def _at(times_s: Float64, truth: TrueTrack, errors: SingleObjectErrors) -> Float64:
    """Return (K,) the centre errors in all frames of the truth, NaN where there is none."""
    found = np.full(len(times_s), np.nan)
    found[np.isin(truth.frames, errors.frames)] = errors.center_m
    return found


def _table(config: SingleObjectStudyConfig, scenes: Sequence[_Scene]) -> str:
    rows: list[list[Cell]] = [
        [scene.scenario.name, name, *_cells(metrics)]
        for scene in scenes
        for name, metrics in scene.metrics.items()
    ]
    frames = len(scenes[0].truth)
    title = (
        f"following a {config.kind.lower()} by {config.sensor.name}, {frames} frames a scene; errors are means "
        f"over all frames, hidden ones too; found again: s until seen with an overlap over {_REACQUIRED_IOU:g}"
    )
    return format_table(title, _COLUMNS, rows)


def _cells(metrics: SingleObjectStudyMetrics) -> list[Cell]:
    if metrics.refusal is not None:
        return [None] * (len(_COLUMNS) - 2)
    scores = metrics.scores
    again_s = metrics.reacquired_s
    return [
        _digits(scores.center_m, 2),
        _digits(scores.center_px, 1),
        _digits(np.degrees(scores.heading_rad), 1),
        *(
            f"{100 * share:.0f} %"
            for share in (scores.seen, scores.predicted, scores.lost, scores.drifted)
        ),
        "never" if np.isinf(again_s) else _digits(again_s, 1),
        _digits(scores.ms_per_frame, 1),
    ]


def _digits(value: float, digits: int) -> str | None:
    return f"{value:.{digits}f}" if np.isfinite(value) else None
