"""Metrics of tracked moving objects on the ground plane, against labels or exact truth.

- HOTA, CLEAR and identity are computed by distance (similarity 1 less the distance of the centres over
  `max_distance_m`) and by overlap (IoU of the outlines); CLEAR and identity at the thresholds given.
- An object moves while its box travels over the ground, by label boxes and INS poses or by exact positions of
  a synthetic drive, with hysteresis; its velocity is the median of those between all pairs of its positions
  within `window_s`, or exact.
- Errors are those of matched tracks; the heading is that of tracks faster than 1 m/s.
- False tracks match no object in more than half of the frames in which they are evaluated or ignored.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from perception.evaluation.config import DatmoProtocol
from perception.evaluation.multi_object import track_assignment
from perception.evaluation.multi_object.false_tracks import (
    FalseTracks,
    TrackOutcomes,
    find_false_tracks,
    track_outcomes,
)
from perception.evaluation.multi_object.mot_metrics import MotMetrics, evaluate_tracks, mot_table
from perception.evaluation.multi_object.moving_scene import MovingScene
from perception.evaluation.multi_object.target_errors import (
    ERROR_COLUMNS,
    OBJECT_COLUMNS,
    TargetErrors,
    target_errors,
)
from perception.evaluation.multi_object.track_assignment import (
    SimilarityFrames,
    assign_tracks,
    similarity_frames,
)
from perception.evaluation.report import Column, Report, Table
from perception.types import Float64, Frame, Labels, PointTruth, Result

PROTOCOL_WORDS = {"tracks": track_assignment.__doc__, "metrics": __doc__}


class MovingObjectTruth(Protocol):
    """Moving objects of a drive, frame by frame."""

    def scene(self, frame: Frame, clearance_m: float) -> MovingScene | None:
        """Return the objects of a frame, or None where its labels have no pose."""
        ...

    def types(self) -> dict[int, str]:
        """Return the class name of every object by track id."""
        ...


@dataclass(frozen=True)
class DatmoReport:
    """Metrics of the tracks of one method on one drive.

    Attributes:
        protocol: Protocol of the evaluation.
        duration_s: Duration of the evaluated frames in s.
        by_distance: Metrics by distance of the centres.
        by_overlap: Metrics by overlap of the outlines.
        by_loose_overlap: Metrics by overlap with CLEAR and identity at the loose threshold.
        errors: Errors at the objects that must be tracked, in each frame.
        types: Class name of each labelled object.
        false_tracks: Tracks that match no moving object.
        seconds: (F,) Time in s of detection and tracking in each evaluated frame.
    """

    protocol: DatmoProtocol
    duration_s: float
    by_distance: MotMetrics
    by_overlap: MotMetrics
    by_loose_overlap: MotMetrics
    errors: TargetErrors
    types: Mapping[int, str]
    false_tracks: FalseTracks
    seconds: Float64

    @property
    def frames(self) -> int:
        """Number of evaluated frames."""
        return len(self.seconds)

    def time_ms(self, quantile: float | None = None) -> float:
        """Return the mean time per frame in ms, or a quantile; NaN without a frame."""
        if not self.frames:
            return float("nan")
        seconds = self.seconds
        return 1000 * float(seconds.mean() if quantile is None else np.quantile(seconds, quantile))

    @property
    def never_tracked(self) -> list[int]:
        """Ids of the objects that no track ever matched."""
        return [number for number, rows in self.errors.by_object().items() if not len(rows.matched)]

    def object_table(self, method: str) -> Table[TargetErrors]:
        """Return the table of the objects that must be tracked."""
        kind = Column[TargetErrors](
            "type", lambda e: self.types.get(int(e.object_ids[0])), "", "type"
        )
        rows = {str(number): rows for number, rows in self.errors.by_object().items()}
        title = f"Objects that must be tracked: {method}"
        return Table(title, (kind, *OBJECT_COLUMNS), rows, heading="object")

    def to_json(self) -> dict[str, Any]:
        """Return all metrics by name."""
        return {
            "frames": self.frames,
            "duration_s": self.duration_s,
            "by_distance": self.by_distance.to_json(),
            "by_overlap": self.by_overlap.to_json(),
            "by_loose_overlap": self.by_loose_overlap.to_json(),
            "never_tracked": self.never_tracked,
            "false_tracks": self.false_tracks,
            "objects": self.object_table("").to_json(),
            **Table("", _TRACK_COLUMNS, {"": self}).to_json()[""],
        }


_Report = Column[DatmoReport]
_TRACK_COLUMNS: tuple[Column[DatmoReport], ...] = (
    _Report("never tracked", lambda r: len(r.never_tracked)),
    _Report("false tracks", lambda r: len(r.false_tracks.ids)),
    _Report("/min", lambda r: r.false_tracks.per_minute, ".1f"),
    _Report("never matched", lambda r: len(r.false_tracks.never_matched)),
    _Report("of these on parked vehicles", lambda r: len(r.false_tracks.on_parked)),
    *(column.of(lambda r: r.errors.matched) for column in ERROR_COLUMNS),
    _Report("mean [ms]", lambda r: r.time_ms(), ".1f", "ms_per_frame"),
    _Report("p99 [ms]", lambda r: r.time_ms(0.99), ".1f", "ms_p99"),
)


@dataclass(frozen=True)
class DatmoComparison(Report):
    """Reports of several methods on the same scans.

    Attributes:
        reports: Report of each method, by name.
    """

    reports: Mapping[str, DatmoReport]

    def tables(self) -> list[Table[Any]]:
        """Return the metrics with methods as rows, then the objects of each method."""
        protocol = next(iter(self.reports.values())).protocol
        within_m = protocol.targets.max_distance_m * (1 - protocol.distance_threshold)
        where, unit = "on the ground plane; CLEAR and identity", "ratios in percent"
        distance = f"By distance of the centres {where} within {within_m:g} m; {unit}"
        overlap = f"By overlap {where} at IoU {protocol.overlap_threshold:g}; {unit}"
        loose = f"By overlap {where} at IoU {protocol.loose_overlap_threshold:g}; {unit}"
        reports, errors = (
            self.reports,
            "False tracks, and errors of matched tracks (medians; extent: means)",
        )
        return [
            mot_table(distance, {name: report.by_distance for name, report in reports.items()}),
            mot_table(overlap, {name: report.by_overlap for name, report in reports.items()}),
            mot_table(loose, {name: report.by_loose_overlap for name, report in reports.items()}),
            Table(errors, _TRACK_COLUMNS, reports),
            *(report.object_table(name) for name, report in reports.items()),
        ]

    def to_json(self) -> dict[str, Any]:
        """Return all metrics by method."""
        return {method: report.to_json() for method, report in self.reports.items()}


class DatmoMeasure:
    """Accumulates the metrics of one method's tracks over the frames of a drive."""

    def __init__(self, truth: MovingObjectTruth, protocol: DatmoProtocol | None = None) -> None:
        """Start without a frame.

        Args:
            truth: Moving objects of the drive.
            protocol: Protocol of the evaluation.
        """
        self._truth, self._protocol = truth, protocol or DatmoProtocol()
        self._stamps_s: list[float] = []
        self._seconds: list[float] = []
        self._similarities: list[SimilarityFrames] = []
        self._errors: list[TargetErrors] = []
        self._outcomes: list[TrackOutcomes] = []

    def update(
        self, result: Result, labels: Labels | None = None, truth: PointTruth | None = None
    ) -> None:
        """Add one frame; a frame whose labels have no pose is left out.

        Args:
            result: Frame with its tracks and with the time of the stage `moving objects`.
            labels: Not read: the moving objects of the drive are used.
            truth: Not read.
        """
        frame, tracks, targets = result.frame, result.tracks, self._protocol.targets
        scene = self._truth.scene(frame, targets.clearance_m)
        if scene is None:
            return
        assignment = assign_tracks(scene, tracks, targets)
        self._stamps_s.append(frame.stamp_s)
        self._seconds.append(result.timings_s.get("moving objects", np.nan))
        self._similarities.append(similarity_frames(scene, tracks, assignment, targets))
        self._errors.append(target_errors(frame.stamp_s, scene, tracks, assignment))
        self._outcomes.append(track_outcomes(tracks, assignment))

    def compute(self) -> DatmoReport:
        """Return the metrics of all frames so far."""
        protocol, errors = self._protocol, TargetErrors.concatenate(self._errors)
        duration_s = _duration_s(self._stamps_s)
        by_distance = [frame.by_distance for frame in self._similarities]
        by_overlap = [frame.by_overlap for frame in self._similarities]
        return DatmoReport(
            protocol=protocol,
            duration_s=duration_s,
            by_distance=evaluate_tracks(by_distance, protocol.distance_threshold),
            by_overlap=evaluate_tracks(by_overlap, protocol.overlap_threshold),
            by_loose_overlap=evaluate_tracks(by_overlap, protocol.loose_overlap_threshold),
            errors=errors,
            types=self._truth.types(),
            false_tracks=find_false_tracks(TrackOutcomes.concatenate(self._outcomes), duration_s),
            seconds=np.array(self._seconds, np.float64),
        )


def _duration_s(stamps_s: Sequence[float]) -> float:
    """Return the duration of all frames, the last as long as the others on average."""
    if len(stamps_s) < 2:
        return 0.0
    return (stamps_s[-1] - stamps_s[0]) * len(stamps_s) / (len(stamps_s) - 1)
