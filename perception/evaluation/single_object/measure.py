"""Metrics of trackers of one object, side by side: of each sequence, of all together, and by challenge."""

import dataclasses
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from perception.evaluation.config import SingleObjectMetricsConfig
from perception.evaluation.report import Column, Table, Value
from perception.evaluation.single_object.challenges import (
    CHALLENGE_DESCRIPTIONS,
    Challenge,
    ChallengeConfig,
    Variations,
    variations,
)
from perception.evaluation.single_object.errors import SingleObjectErrors, single_object_errors
from perception.evaluation.single_object.metrics import METRIC_WORDS, SingleObjectMetrics
from perception.evaluation.single_object.metrics import single_object_metrics as metrics_of
from perception.evaluation.single_object.track import ObjectSequence
from perception.evaluation.single_object.tracker_runs import TargetObject, TrackerRun
from perception.types import Calibration

_TOGETHER = "together"
_PRINTED = "thesis H-Fus"
_Metric = Callable[[SingleObjectMetrics], Value]

PROTOCOL_WORDS = {
    **METRIC_WORDS,
    "challenges": {str(one): words for one, words in CHALLENGE_DESCRIPTIONS.items()},
}


@dataclass(frozen=True)
class OtdProtocol:
    """Protocol of the evaluation of trackers of one object.

    Attributes:
        metrics: Thresholds at which a frame counts as correct.
        challenges: Limits from which a variation of the labels is a challenge.
    """

    metrics: SingleObjectMetricsConfig = field(default_factory=SingleObjectMetricsConfig)
    challenges: ChallengeConfig = field(default_factory=ChallengeConfig)


@dataclass(frozen=True)
class ObjectReport:
    """Metrics of every tracker on one object.

    Attributes:
        sequence: Object and its frames, as far as they are available.
        labelled: Number of frames in which the position of the object is known.
        total_frames: Number of frames of the sequence if all of them were available.
        variation: Variation of the object's labels.
        challenges: Variations that are challenges.
        errors: Errors by tracker, without those that could not be initialised.
        metrics: Metrics by tracker, without those that could not be initialised.
        refusals: Reasons why trackers could not be initialised, by tracker.
    """

    sequence: ObjectSequence
    labelled: int
    total_frames: int
    variation: Variations
    challenges: tuple[Challenge, ...]
    errors: Mapping[str, SingleObjectErrors]
    metrics: Mapping[str, SingleObjectMetrics]
    refusals: Mapping[str, str]


class SingleObjectMeasure:
    """Accumulates the metrics of trackers of one object, object after object."""

    def __init__(self, trackers: Sequence[str], protocol: OtdProtocol | None = None) -> None:
        """Start without an object.

        Args:
            trackers: Names of the trackers, in the order of the tables.
            protocol: Protocol of the evaluation.
        """
        self._trackers, self._protocol = tuple(trackers), protocol or OtdProtocol()
        self._objects: list[ObjectReport] = []

    def update(
        self, target: TargetObject, runs: Mapping[str, TrackerRun], camera: Calibration | None
    ) -> None:
        """Add one object.

        Args:
            target: Object and its true track.
            runs: Output of each tracker by name.
            camera: Calibration of the drive's camera, or None.
        """
        errors = {
            name: single_object_errors(target.truth, run.track, camera)
            for name, run in runs.items()
            if run.refusal is None
        }
        variation, config = variations(target.truth), self._protocol.metrics
        refusals = {name: run.refusal for name, run in runs.items() if run.refusal is not None}
        self._objects.append(
            ObjectReport(
                sequence=target.sequence,
                labelled=len(target.truth),
                total_frames=target.total_frames,
                variation=variation,
                challenges=variation.challenges(self._protocol.challenges),
                errors=errors,
                metrics={name: metrics_of(one, config) for name, one in errors.items()},
                refusals=refusals,
            )
        )

    def compute(self) -> "SingleObjectReport":
        """Return the metrics of all objects so far."""
        return SingleObjectReport(self._protocol, self._trackers, tuple(self._objects))


@dataclass(frozen=True)
class SingleObjectReport:
    """Metrics of trackers of one object, over several objects.

    Attributes:
        protocol: Protocol of the evaluation.
        trackers: Names of the trackers, in the order of the tables.
        objects: Metrics of each object.
    """

    protocol: OtdProtocol
    trackers: tuple[str, ...]
    objects: tuple[ObjectReport, ...]

    def objects_with(self, challenge: Challenge | None) -> list[ObjectReport]:
        """Return the objects with a challenge, or all."""
        return [one for one in self.objects if challenge is None or challenge in one.challenges]

    def errors_of(
        self, tracker: str, challenge: Challenge | None = None
    ) -> SingleObjectErrors | None:
        """Return the errors in all frames, or in those of objects with a challenge; None without a frame."""
        objects = self.objects_with(challenge)
        parts = [one.errors[tracker] for one in objects if tracker in one.errors]
        return SingleObjectErrors.concatenate(parts) if parts else None

    def metrics_of(
        self, tracker: str, challenge: Challenge | None = None
    ) -> SingleObjectMetrics | None:
        """Return the metrics of all these frames together."""
        errors = self.errors_of(tracker, challenge)
        return None if errors is None else metrics_of(errors, self.protocol.metrics)

    def tables(self) -> list[Table[Any]]:
        """Return the objects, the metrics with trackers side by side, by challenge, and each tracker in detail."""
        tables: list[Table[Any]] = [
            self._object_table(),
            *(self._side_by_side(*one) for one in _comparisons(self.protocol.metrics)),
            *self._challenge_tables(),
            *(self._detail_table(name) for name in self.trackers),
        ]
        notes = [
            f"{name} does not track {one.sequence.name}: {reason}"
            for one in self.objects
            for name, reason in one.refusals.items()
        ]
        if notes:
            tables[-1] = dataclasses.replace(tables[-1], notes=("", *notes))
        return tables

    def _rows(self) -> dict[str, ObjectReport]:
        """Return the objects by name, with the drive where a name occurs in several."""
        count = Counter(one.sequence.name for one in self.objects)
        return {
            one.sequence.name
            if count[one.sequence.name] == 1
            else f"{one.sequence.sequence} {one.sequence.name}": one
            for one in self.objects
        }

    def _by_tracker(self) -> dict[str, Mapping[str, SingleObjectMetrics | None]]:
        """Return the metrics of each object and of all together, by tracker."""
        rows: dict[str, Mapping[str, SingleObjectMetrics | None]] = {
            name: one.metrics for name, one in self._rows().items()
        }
        if len(self.objects) > 1:
            rows[_TOGETHER] = {name: self.metrics_of(name) for name in self.trackers}
        return rows

    def _object_table(self) -> Table[ObjectReport]:
        title = "Objects to track; challenges from the labels"
        return Table(title, _OBJECT_COLUMNS, self._rows(), heading="sequence")

    def _side_by_side(self, title: str, metric: _Metric, spec: str, key: str | None) -> Table[Any]:
        """Return one metric with a row a sequence and a column a tracker, as in Tables 7.6 and 7.7."""
        rows = self._by_tracker()
        columns: list[Column[Any]] = [
            Column(name, lambda row, name=name: _value(row.get(name), metric), spec)  # type: ignore[misc]
            for name in self.trackers
        ]
        if key is not None and any(key in one.sequence.stated for one in self.objects):
            printed = {
                id(rows[name]): one.sequence.stated.get(key) for name, one in self._rows().items()
            }
            columns.append(Column(_PRINTED, lambda row: printed.get(id(row))))
        return Table(title, columns, rows)

    def _challenge_tables(self) -> list[Table[Any]]:
        groups = [one for one in Challenge if self.objects_with(one)]
        if len(self.objects) < 2 or not groups:
            return []
        rows = {name: {one: self.metrics_of(name, one) for one in groups} for name in self.trackers}
        metrics: dict[str, _Metric] = {
            "Overlap success [%] by challenge, over all frames of its sequences": (
                lambda m: 100 * m.overlap_success
            ),
            "Heading success [%] by challenge": lambda m: 100 * m.heading_success,
        }
        return [
            Table(title, [self._challenge_column(one, metric) for one in groups], rows)
            for title, metric in metrics.items()
        ]

    def _challenge_column(self, challenge: Challenge, metric: _Metric) -> Column[Any]:
        name = f"{challenge} ({len(self.objects_with(challenge))})"
        return Column(name, lambda row: _value(row[challenge], metric), ".1f")

    def _detail_table(self, tracker: str) -> Table[Any]:
        rows = {name: row.get(tracker) for name, row in self._by_tracker().items()}
        together = rows.get(_TOGETHER)
        if together is not None:
            rows[_TOGETHER] = dataclasses.replace(together, lost_from_frame=None)
        columns = [
            Column(name, lambda row, metric=metric: _value(row, metric), spec)  # type: ignore[misc]
            for name, metric, spec in _DETAILS
        ]
        return Table(f"{tracker}: errors, states that it reports, drift, time", columns, rows)

    def to_json(self) -> dict[str, Any]:
        """Return the metrics of each object, of all together, and by challenge."""
        return {
            "objects": [
                {
                    "sequence": one.sequence,
                    "labelled_frames": one.labelled,
                    "total_frames": one.total_frames,
                    "variations": one.variation,
                    "challenges": one.challenges,
                    "metrics": dict(one.metrics),
                    "refusals": dict(one.refusals),
                }
                for one in self.objects
            ],
            _TOGETHER: {name: self.metrics_of(name) for name in self.trackers},
            "by_challenge": {
                str(one): {name: self.metrics_of(name, one) for name in self.trackers}
                for one in Challenge
                if self.objects_with(one)
            },
        }


def _value(metrics: SingleObjectMetrics | None, metric: _Metric) -> Value:
    return None if metrics is None else metric(metrics)


def _lost_from(metrics: SingleObjectMetrics) -> Value:
    return metrics.lost_from_frame


_OBJECT_COLUMNS = (
    Column[ObjectReport]("drive", lambda o: o.sequence.sequence),
    Column[ObjectReport]("track", lambda o: o.sequence.track_id),
    Column[ObjectReport]("type", lambda o: o.sequence.kind),
    Column[ObjectReport]("frames", lambda o: f"{o.sequence.first_frame}-{o.sequence.last_frame}"),
    Column[ObjectReport]("labelled", lambda o: o.labelled),
    Column[ObjectReport]("of", lambda o: o.total_frames),
    Column[ObjectReport]("challenges", lambda o: " ".join(o.challenges) or None),
    Column[ObjectReport]("occluded [%]", lambda o: 100 * o.variation.occluded_share, ".0f"),
    Column[ObjectReport]("turn [deg]", lambda o: o.variation.turn_deg, ".0f"),
    Column[ObjectReport]("distance ratio", lambda o: o.variation.distance_ratio, ".1f"),
    Column[ObjectReport]("speed change [m/s]", lambda o: o.variation.speed_change_m_s, ".1f"),
)


def _comparisons(
    config: SingleObjectMetricsConfig,
) -> list[tuple[str, _Metric, str, str | None]]:
    """Return title, metric, format and the name under which the thesis prints the metric of H-Fus, if it does."""
    return [
        (
            "E3D (7.3): mean distance of the box centres [m]",
            lambda m: m.center_m,
            ".3f",
            "printed_E3D_m",
        ),
        (
            "E2D (7.3): mean distance of the rectangles' centres in the image, clipped to it [px]",
            lambda m: m.center_px,
            ".1f",
            "printed_E2D_px",
        ),
        (
            "E_phi (7.4): mean heading error, folded to 0..pi/2 [rad]",
            lambda m: m.folded_heading_rad,
            ".3f",
            "printed_E_phi_rad",
        ),
        ("Mean heading error, 0..pi [rad]", lambda m: m.heading_rad, ".3f", None),
        (
            f"Overlap success (A.1): frames with 3D IoU above {config.overlap:.0%} [%]",
            lambda m: 100 * m.overlap_success,
            ".1f",
            None,
        ),
        (
            f"Heading success (A.2): frames within {config.heading_deg:g} deg [%]",
            lambda m: 100 * m.heading_success,
            ".1f",
            None,
        ),
        (
            f"Location success (A.3): frames within {config.location_px:g} px [%]",
            lambda m: 100 * m.location_success,
            ".1f",
            None,
        ),
        (
            "Success, one-pass evaluation: area under 3D overlap 0..1 [%]",
            lambda m: 100 * m.success,
            ".1f",
            None,
        ),
        (
            f"Precision, one-pass evaluation: area under centre error 0..{config.max_center_error_m:g} m [%]",
            lambda m: 100 * m.precision,
            ".1f",
            None,
        ),
    ]


_DETAILS: tuple[tuple[str, _Metric, str], ...] = (
    ("frames", lambda m: m.frames, ""),
    ("E3D [m]", lambda m: m.center_m, ".3f"),
    ("E2D [px]", lambda m: m.center_px, ".1f"),
    ("in image [%]", lambda m: 100 * m.in_image, ".1f"),
    ("E_phi [rad]", lambda m: m.folded_heading_rad, ".3f"),
    ("bias [rad]", lambda m: m.heading_bias_rad, ".3f"),
    ("velocity [m/s]", lambda m: m.velocity_m_s, ".3f"),
    ("overlap [%]", lambda m: 100 * m.overlap_success, ".1f"),
    ("Success [%]", lambda m: 100 * m.success, ".1f"),
    ("Precision [%]", lambda m: 100 * m.precision, ".1f"),
    ("seen [%]", lambda m: 100 * m.seen, ".1f"),
    ("predicted [%]", lambda m: 100 * m.predicted, ".1f"),
    ("lost [%]", lambda m: 100 * m.lost, ".1f"),
    ("drifted [%]", lambda m: 100 * m.drifted, ".1f"),
    ("lost from frame", _lost_from, ""),
    ("mean [ms]", lambda m: m.ms_per_frame, ".2f"),
    ("p99 [ms]", lambda m: m.ms_p99, ".2f"),
)
