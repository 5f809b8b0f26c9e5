"""Metrics of trackers of one object, side by side: of each sequence, of all together, and by challenge."""

import inspect
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from perception.evaluation.config import SingleObjectMetricsConfig
from perception.evaluation.report import Column, Report, Table, Value
from perception.evaluation.single_object.challenges import (
    CHALLENGE_DESCRIPTIONS,
    Challenge,
    Variations,
    variations,
)
from perception.evaluation.single_object.errors import SingleObjectErrors, single_object_errors
from perception.evaluation.single_object.metrics import SingleObjectMetrics, single_object_metrics
from perception.evaluation.single_object.track import TargetObject
from perception.evaluation.single_object.tracker_runs import TrackerRun
from perception.types import Calibration

_TOGETHER = "together"  # over all frames of all sequences, not a mean of the sequences
_Metrics = Mapping[str, SingleObjectMetrics | None]


@dataclass(frozen=True)
class ObjectErrors:
    """Errors of every tracker on one object.

    Attributes:
        target: Object and its true track.
        errors: Errors by tracker, without those that could not be initialised.
        refusals: Reasons why trackers could not be initialised, by tracker.
    """

    target: TargetObject
    errors: Mapping[str, SingleObjectErrors]
    refusals: Mapping[str, str]

    @property
    def variation(self) -> Variations:
        """Variation of the object's labels."""
        return variations(self.target.truth)


@dataclass(frozen=True)
class SingleObjectReport(Report):
    """Metrics of trackers of one object, over several objects.

    Attributes:
        config: Thresholds at which a frame counts as correct.
        trackers: Names of the trackers, in the order of the tables.
        objects: Errors of each object.
    """

    config: SingleObjectMetricsConfig
    trackers: tuple[str, ...]
    objects: tuple[ObjectErrors, ...]

    @property
    def protocol(self) -> dict[str, Any]:
        """Rules of the measure in words and values."""
        return {
            "metrics": inspect.getdoc(SingleObjectMetrics),
            "challenges": CHALLENGE_DESCRIPTIONS,
            "values": {"metrics": self.config, "challenges": Variations()},
        }

    def objects_with(self, challenge: Challenge | None) -> list[ObjectErrors]:
        """Return the objects with a challenge, or all."""
        return [
            o for o in self.objects if challenge is None or challenge in o.variation.challenges()
        ]

    def errors_of(
        self, tracker: str, challenge: Challenge | None = None
    ) -> SingleObjectErrors | None:
        """Return the errors in all frames, or in those of objects with a challenge; None without a frame."""
        objects = self.objects_with(challenge)
        parts = [one.errors[tracker] for one in objects if tracker in one.errors]
        return SingleObjectErrors.concatenate(parts) if parts else None

    def metrics_of(self, challenge: Challenge | None = None) -> _Metrics:
        """Return the metrics of all these frames together, by tracker."""
        return self._metrics({name: self.errors_of(name, challenge) for name in self.trackers})

    def _metrics(self, errors: Mapping[str, SingleObjectErrors | None]) -> _Metrics:
        return {
            name: None if one is None else single_object_metrics(one, self.config)
            for name, one in errors.items()
        }

    def tables(self) -> list[Table[Any]]:
        """Return the objects, the metrics with trackers side by side, by challenge, and each tracker in detail."""
        by_name, rows = self._by_name(), self._rows()
        title = "Objects to track; challenges from the labels"
        tables: list[Table[Any]] = [Table(title, _OBJECT_COLUMNS, by_name, "sequence")]
        for title, metric, spec, key in _comparisons(self.config):
            columns = [_column(name, metric, spec, name, title) for name in self.trackers]
            printed = {
                id(rows[name]): one.target.sequence.stated.get(key) for name, one in by_name.items()
            }
            if any(printed.values()):
                columns.append(Column("thesis H-Fus", lambda row, of=printed: of.get(id(row))))  # type: ignore[misc]
            tables.append(Table(title, columns, rows))
        tables += self._challenge_tables()
        for tracker in self.trackers:
            title = f"{tracker}: errors, states that it reports, drift, time"
            details = [
                _column(name, metric, spec, tracker, name) for name, metric, spec in _DETAILS
            ]
            tables.append(Table(title, details, rows))
        notes = [
            f"{name} does not track {one.target.sequence.name}: {reason}"
            for one in self.objects
            for name, reason in one.refusals.items()
        ]
        return [*tables[:-1], replace(tables[-1], notes=("", *notes) if notes else ())]

    def _by_name(self) -> dict[str, ObjectErrors]:
        """Return the objects by name, with the drive where a name occurs in several."""
        sequences = [one.target.sequence for one in self.objects]
        count = Counter(one.name for one in sequences)
        names = [s.name if count[s.name] == 1 else f"{s.sequence} {s.name}" for s in sequences]
        return dict(zip(names, self.objects, strict=True))

    def _rows(self) -> dict[str, _Metrics]:
        """Return the metrics by tracker of each object, and of all together."""
        rows = {name: self._metrics(one.errors) for name, one in self._by_name().items()}
        if len(rows) > 1:
            rows[_TOGETHER] = {
                name: None if one is None else replace(one, lost_from_frame=None)
                for name, one in self.metrics_of().items()
            }
        return rows

    def _challenge_tables(self) -> list[Table[Any]]:
        groups = {one: len(self.objects_with(one)) for one in Challenge if self.objects_with(one)}
        if len(self.objects) < 2:
            return []
        metrics = {f"{one} ({count})": self.metrics_of(one) for one, count in groups.items()}
        rows = {t: {name: row[t] for name, row in metrics.items()} for t in self.trackers}
        titles = {
            "overlap_success": "Overlap success [%] by challenge, over all frames of its sequences",
            "heading_success": "Heading success [%] by challenge",
        }
        return [
            Table(title, [_column(name, metric, ".1f", name, title) for name in metrics], rows)
            for metric, title in titles.items()
            if metrics
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the metrics of each object, of all together, and by challenge."""
        return {
            "objects": [
                {
                    "sequence": one.target.sequence,
                    "labelled_frames": len(one.target.truth),
                    "total_frames": one.target.total_frames,
                    "variations": one.variation,
                    "challenges": one.variation.challenges(),
                    "metrics": self._metrics(one.errors),
                    "refusals": one.refusals,
                }
                for one in self.objects
            ],
            _TOGETHER: self.metrics_of(),
            "by_challenge": {
                str(one): self.metrics_of(one) for one in Challenge if self.objects_with(one)
            },
        }


class SingleObjectMeasure:
    """Accumulates the metrics of trackers of one object, object after object."""

    def __init__(
        self, trackers: Sequence[str], config: SingleObjectMetricsConfig | None = None
    ) -> None:
        """Start without an object.

        Args:
            trackers: Names of the trackers, in the order of the tables.
            config: Thresholds at which a frame counts as correct.
        """
        self._trackers, self._config = tuple(trackers), config or SingleObjectMetricsConfig()
        self._objects: list[ObjectErrors] = []

    def update(
        self, target: TargetObject, runs: Mapping[str, TrackerRun], camera: Calibration | None
    ) -> None:
        """Add one object.

        Args:
            target: Object and its true track.
            runs: Output of each tracker by name.
            camera: Calibration of the drive's camera, or None.
        """
        refusals = {name: run.refusal for name, run in runs.items() if run.refusal is not None}
        errors = {
            name: single_object_errors(target.truth, run.track, camera)
            for name, run in runs.items()
            if name not in refusals
        }
        self._objects.append(ObjectErrors(target, errors, refusals))

    def compute(self) -> SingleObjectReport:
        """Return the metrics of all objects so far."""
        return SingleObjectReport(self._config, self._trackers, tuple(self._objects))


def _column(name: str, metric: str, spec: str, tracker: str, unit: str) -> Column[Any]:
    """Return the column of a metric of one tracker; percent is in `unit` where a share is printed so."""

    def value(row: _Metrics) -> Value:
        metrics = row.get(tracker)
        found: Value = None if metrics is None else getattr(metrics, metric)
        return 100 * found if "[%]" in unit and isinstance(found, float) else found

    return Column(name, value, spec)


# fmt: off
_OBJECT_COLUMNS: tuple[Column[ObjectErrors], ...] = (
    Column("drive", lambda o: o.target.sequence.sequence),
    Column("track", lambda o: o.target.sequence.track_id),
    Column("type", lambda o: o.target.sequence.kind),
    Column("frames", lambda o: o.target.sequence.frame_range),
    Column("labelled", lambda o: len(o.target.truth)),
    Column("of", lambda o: o.target.total_frames),
    Column("challenges", lambda o: " ".join(o.variation.challenges()) or None),
    Column("occluded [%]", lambda o: 100 * o.variation.occluded_share, ".0f"),
    Column("turn [deg]", lambda o: o.variation.turn_deg, ".0f"),
    Column("distance ratio", lambda o: o.variation.distance_ratio, ".1f"),
    Column("speed change [m/s]", lambda o: o.variation.speed_change_m_s, ".1f"),
)
_DETAILS = (
    ("frames", "frames", ""), ("E3D [m]", "center_m", ".3f"), ("E2D [px]", "center_px", ".1f"),
    ("in image [%]", "in_image", ".1f"), ("E_phi [rad]", "folded_heading_rad", ".3f"),
    ("bias [rad]", "heading_bias_rad", ".3f"), ("velocity [m/s]", "velocity_m_s", ".3f"),
    ("overlap [%]", "overlap_success", ".1f"), ("Success [%]", "success", ".1f"),
    ("Precision [%]", "precision", ".1f"), ("seen [%]", "seen", ".1f"),
    ("predicted [%]", "predicted", ".1f"), ("lost [%]", "lost", ".1f"),
    ("drifted [%]", "drifted", ".1f"), ("lost from frame", "lost_from_frame", ""),
    ("mean [ms]", "ms_per_frame", ".2f"), ("p99 [ms]", "ms_p99", ".2f"),
)
# fmt: on


def _comparisons(config: SingleObjectMetricsConfig) -> list[tuple[str, str, str, str]]:
    """Return title, metric, format, and the name under which the thesis prints the metric of H-Fus, if it does."""
    # fmt: off
    return [
        ("E3D (7.3): mean distance of the box centres [m]", "center_m", ".3f", "printed_E3D_m"),
        ("E2D (7.3): mean distance of the rectangles' centres in the image, clipped to it [px]",
         "center_px", ".1f", "printed_E2D_px"),
        ("E_phi (7.4): mean heading error, folded to 0..pi/2 [rad]",
         "folded_heading_rad", ".3f", "printed_E_phi_rad"),
        ("Mean heading error, 0..pi [rad]", "heading_rad", ".3f", ""),
        (f"Overlap success (A.1): frames with 3D IoU above {config.overlap:.0%} [%]",
         "overlap_success", ".1f", ""),
        (f"Heading success (A.2): frames within {config.heading_deg:g} deg [%]",
         "heading_success", ".1f", ""),
        (f"Location success (A.3): frames within {config.location_px:g} px [%]",
         "location_success", ".1f", ""),
        ("Success, one-pass evaluation: area under 3D overlap 0..1 [%]", "success", ".1f", ""),
        ("Precision, one-pass evaluation: area under centre error "
         f"0..{config.max_center_error_m:g} m [%]", "precision", ".1f", ""),
    ]
    # fmt: on
