"""Metrics of trackers of one object, side by side: of each sequence, of all together, and by challenge."""

import inspect
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from perception.evaluation.config import MAX_CENTER_M, MAX_HEADING_DEG, MAX_LOCATION_PX, MIN_OVERLAP
from perception.evaluation.report import Column, Report, Table, value_table
from perception.evaluation.single_object.challenges import (
    CHALLENGE_DESCRIPTIONS,
    Challenge,
    Variations,
    variations,
)
from perception.evaluation.single_object.metrics import (
    SingleObjectErrors,
    SingleObjectMetrics,
    single_object_errors,
    single_object_metrics,
)
from perception.evaluation.single_object.track import TargetObject
from perception.evaluation.single_object.tracker_runs import TrackerRun
from perception.types import Calibration

_TOGETHER = "together"  # over all frames of all sequences, not a mean of the sequences
_Metrics = Mapping[str, SingleObjectMetrics | None]

PROTOCOL = {
    "metrics": inspect.getdoc(SingleObjectMetrics),
    "challenges": CHALLENGE_DESCRIPTIONS,
    "values": {
        "metrics": {
            "overlap": MIN_OVERLAP,
            "heading_deg": MAX_HEADING_DEG,
            "location_px": MAX_LOCATION_PX,
            "max_center_error_m": MAX_CENTER_M,
        },
        "challenges": asdict(Variations()),
    },
}


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
        trackers: Names of the trackers, in the order of the tables.
        objects: Errors of each object.
    """

    trackers: tuple[str, ...]
    objects: tuple[ObjectErrors, ...]

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
        return _metrics({name: self.errors_of(name, challenge) for name in self.trackers})

    def tables(self) -> list[Table[Any]]:
        """Return the objects, the metrics with trackers side by side, by challenge, and each tracker in detail."""
        by_name, rows = self._by_name(), self._rows()
        title = "Objects to track; challenges from the labels"
        tables: list[Table[Any]] = [Table(title, _OBJECT_COLUMNS, by_name, "sequence")]
        tables += [self._comparison(one, rows) for one in _COMPARISONS]
        tables += self._challenge_tables()
        details = SingleObjectMetrics.columns()
        for tracker in self.trackers:
            of_tracker = {name: row.get(tracker) for name, row in rows.items()}
            title = f"{tracker}: errors, states that it reports, drift, time"
            tables.append(Table(title, details, of_tracker))
        notes = [
            f"{name} does not track {one.target.sequence.name}: {reason}"
            for one in self.objects
            for name, reason in one.refusals.items()
        ]
        return [*tables[:-1], replace(tables[-1], notes=("", *notes) if notes else ())]

    def _comparison(self, metric: "_Comparison", rows: Mapping[str, _Metrics]) -> Table[Any]:
        """Return the trackers side by side, below each sequence the values that the thesis prints of them."""
        values: dict[str, Mapping[str, float | None]] = {}
        notes: tuple[str, ...] = ()
        by_name = self._by_name()
        for name, row in rows.items():
            values[name] = _values(row, metric.value)
            printed = by_name[name].target.sequence.printed if name in by_name else {}
            if metric.name in printed:
                values[f"{name} thesis"] = {
                    tracker: printed[metric.name].get(tracker) for tracker in self.trackers
                }
                notes = (_PRINTED_NOTE,)
        return replace(value_table(metric.title, values, metric.spec), notes=notes)

    def _by_name(self) -> dict[str, ObjectErrors]:
        """Return the objects by name, with the drive where a name occurs in several."""
        sequences = [one.target.sequence for one in self.objects]
        count = Counter(one.name for one in sequences)
        names = [s.name if count[s.name] == 1 else f"{s.sequence} {s.name}" for s in sequences]
        return dict(zip(names, self.objects, strict=True))

    def _rows(self) -> dict[str, _Metrics]:
        """Return the metrics by tracker of each object, and of all together."""
        rows = {name: _metrics(one.errors) for name, one in self._by_name().items()}
        if len(rows) > 1:
            rows[_TOGETHER] = {
                name: None if one is None else replace(one, lost_from_frame=None)
                for name, one in self.metrics_of().items()
            }
        return rows

    def _challenge_tables(self) -> list[Table[Any]]:
        groups = {one: len(self.objects_with(one)) for one in Challenge if self.objects_with(one)}
        if len(self.objects) < 2 or not groups:
            return []
        metrics = {f"{one} ({count})": self.metrics_of(one) for one, count in groups.items()}
        rows = {t: {name: row[t] for name, row in metrics.items()} for t in self.trackers}
        overlaps = {t: _values(row, lambda m: m.overlap_success) for t, row in rows.items()}
        headings = {t: _values(row, lambda m: m.heading_success) for t, row in rows.items()}
        title = "Overlap success [%] by challenge, over all frames of its sequences"
        return [
            value_table(title, overlaps, ".1%"),
            value_table("Heading success [%] by challenge", headings, ".1%"),
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
                    "metrics": _metrics(one.errors),
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

    def __init__(self, trackers: Sequence[str]) -> None:
        """Start without an object, for the trackers in the order of the tables."""
        self._trackers = tuple(trackers)
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
        return SingleObjectReport(self._trackers, tuple(self._objects))


def _metrics(errors: Mapping[str, SingleObjectErrors | None]) -> _Metrics:
    return {n: None if one is None else single_object_metrics(one) for n, one in errors.items()}


def _values(
    row: _Metrics, metric: Callable[[SingleObjectMetrics], float]
) -> dict[str, float | None]:
    return {name: None if one is None else metric(one) for name, one in row.items()}


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
# fmt: on


@dataclass(frozen=True)
class _Comparison:
    """A metric with the trackers side by side.

    Attributes:
        name: Name of the field of `SingleObjectMetrics`.
        title: Title of the table.
        spec: Format of the values, that of the thesis where it prints them.
    """

    name: str
    title: str
    spec: str

    def value(self, metrics: SingleObjectMetrics) -> float:
        """Return the metric."""
        return float(getattr(metrics, self.name))


_PRINTED_NOTE = (
    "thesis: as printed; a dash is a tracker that failed there, or that the thesis does not have."
)
_COMPARISONS = (
    _Comparison("center_m", "Table 7.6, E3D (7.3): mean distance of the box centres [m]", ".2f"),
    _Comparison(
        "center_px",
        "Table 7.6, E2D (7.3): mean distance of the rectangles' centres in the image, clipped to it [px]",
        ".1f",
    ),
    _Comparison(
        "folded_heading_rad",
        "Table 7.7, E_phi (7.4): mean heading error, folded to 0..pi/2 [rad]",
        ".2f",
    ),
    _Comparison("heading_rad", "Mean heading error, 0..pi [rad]", ".3f"),
    _Comparison(
        "overlap_success",
        f"Overlap success (A.1): frames with 3D IoU above {MIN_OVERLAP:.0%} [%]",
        ".1%",
    ),
    _Comparison(
        "heading_success",
        f"Heading success (A.2): frames within {MAX_HEADING_DEG:g} deg [%]",
        ".1%",
    ),
    _Comparison(
        "location_success",
        f"Location success (A.3): frames within {MAX_LOCATION_PX:g} px [%]",
        ".1%",
    ),
    _Comparison("success", "Success, one-pass evaluation: area under 3D overlap 0..1 [%]", ".1%"),
    _Comparison(
        "precision",
        f"Precision, one-pass evaluation: area under centre error 0..{MAX_CENTER_M:g} m [%]",
        ".1%",
    ),
)
