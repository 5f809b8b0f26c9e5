"""Metrics of tracked moving objects on the ground plane, against labels or exact truth."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from perception.evaluation.config import DatmoProtocol
from perception.evaluation.multi_object.false_tracks import (
    FalseTracks,
    TrackOutcomes,
    find_false_tracks,
    track_outcomes,
)
from perception.evaluation.multi_object.mot_metrics import MotMetrics, evaluate_tracks, mot_table
from perception.evaluation.multi_object.moving_scene import MovingScene
from perception.evaluation.multi_object.target_errors import (
    ObjectSummary,
    TargetErrors,
    TrackErrors,
    summarise_objects,
    target_errors,
    track_errors,
)
from perception.evaluation.multi_object.track_assignment import (
    SimilarityFrames,
    assign_tracks,
    similarity_frames,
)
from perception.evaluation.report import Column, Table
from perception.types import Float64, Frame, Labels, PointTruth, Result

PROTOCOL_WORDS = {
    "objects": (
        "an object must be tracked in every frame in which it moves, its box's bottom centre is in the "
        "area, the middle of its box is in the camera's view and its box holds min_points points from "
        "clearance_m above its bottom, from the first such frame on: frames before a tracker confirms a "
        "track are misses"
    ),
    "motion": (
        "an object moves while its box travels over the ground, by label boxes and INS poses or by exact "
        "positions of a synthetic drive, with hysteresis; its velocity is the median of those between "
        "all pairs of its positions within window_s, or exact"
    ),
    "pairs": (
        "tracks and objects of a similarity of at least min_similarity are assigned for the greatest sum of "
        "similarity: 1 less the distance of the centres over max_distance_m, or the overlap (IoU) of the "
        "outlines, whichever is greater"
    ),
    "ignored": (
        "a track is neither right nor wrong where it matches an object that moves in some frame of the "
        "drive but need not be tracked in this one, or one of unknown motion, and is more similar to it than "
        "to its own object; it matches by min_similarity or where half of its outline lies on the object; "
        "tracks on parked objects are not ignored"
    ),
    "left_out": (
        "tracks without an object outside the area, outside the view, or with half of their box in the "
        "image in one DontCare region"
    ),
    "metrics": (
        "HOTA, CLEAR and identity on the ground plane, twice: by distance (similarity 1 less the distance "
        "of the centres over max_distance_m) and by overlap (IoU of the outlines); CLEAR and identity at "
        "the thresholds given"
    ),
    "errors": "errors of the matched tracks; heading of tracks faster than 1 m/s; extent as mean absolute error",
    "false_tracks": (
        "ids that match no object in more than half of the frames in which they are evaluated or ignored; "
        "never_matched: those that match no object in any of these frames; on_parked: those that lie on a "
        "parked object in one of them"
    ),
}


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
        frames: Number of evaluated frames.
        duration_s: Duration of these frames in s.
        by_distance: Metrics by distance of the centres.
        by_overlap: Metrics by overlap of the outlines.
        by_loose_overlap: Metrics by overlap with CLEAR and identity at the loose threshold.
        errors: Errors of the matched tracks.
        objects: Summary of each object that must be tracked.
        types: Class name of each labelled object.
        false_tracks: Tracks that match no moving object.
        seconds: (frames,) Time in s of detection and tracking.
    """

    protocol: DatmoProtocol
    frames: int
    duration_s: float
    by_distance: MotMetrics
    by_overlap: MotMetrics
    by_loose_overlap: MotMetrics
    errors: TrackErrors
    objects: Sequence[ObjectSummary]
    types: Mapping[int, str]
    false_tracks: FalseTracks
    seconds: Float64

    @property
    def never_tracked(self) -> list[int]:
        """Ids of the objects that no track ever matched."""
        return [summary.object_id for summary in self.objects if summary.is_never_tracked]

    def time_ms(self, quantile: float | None = None) -> float:
        """Return the mean time per frame, or a quantile of it; NaN without a frame."""
        if not self.frames:
            return float("nan")
        seconds = self.seconds
        return 1000 * float(seconds.mean() if quantile is None else np.quantile(seconds, quantile))


_TRACK_COLUMNS = (
    Column[DatmoReport]("never tracked", lambda r: len(r.never_tracked)),
    Column[DatmoReport]("false tracks", lambda r: len(r.false_tracks.ids)),
    Column[DatmoReport]("/min", lambda r: r.false_tracks.per_minute, ".1f"),
    Column[DatmoReport]("never matched", lambda r: len(r.false_tracks.never_matched)),
    Column[DatmoReport]("of these on parked vehicles", lambda r: len(r.false_tracks.on_parked)),
    Column[DatmoReport]("centre [m]", lambda r: r.errors.center_m, ".3f"),
    Column[DatmoReport]("velocity [m/s]", lambda r: r.errors.velocity_m_s, ".3f"),
    Column[DatmoReport]("mean [m/s]", lambda r: r.errors.mean_velocity_m_s, ".3f"),
    Column[DatmoReport]("heading [rad]", lambda r: r.errors.heading_rad, ".3f"),
    Column[DatmoReport]("length [m]", lambda r: r.errors.length_m, ".3f"),
    Column[DatmoReport]("width [m]", lambda r: r.errors.width_m, ".3f"),
    Column[DatmoReport]("mean [ms]", lambda r: r.time_ms(), ".1f"),
    Column[DatmoReport]("p99 [ms]", lambda r: r.time_ms(0.99), ".1f"),
)

_OBJECT_COLUMNS = (
    Column[ObjectSummary]("[m/s]", lambda s: s.speed_m_s, ".1f"),
    Column[ObjectSummary]("frames", lambda s: s.frames),
    Column[ObjectSummary]("tracked", lambda s: s.frames_tracked),
    Column[ObjectSummary]("tracked [%]", lambda s: 100 * s.share, ".0f"),
    Column[ObjectSummary]("ids", lambda s: s.tracks),
    Column[ObjectSummary]("switches", lambda s: s.switches),
    Column[ObjectSummary]("time to first track [s]", lambda s: s.time_to_first_track_s, ".1f"),
    Column[ObjectSummary]("centre [m]", lambda s: s.center_m, ".3f"),
    Column[ObjectSummary]("velocity [m/s]", lambda s: s.velocity_m_s, ".3f"),
)


@dataclass(frozen=True)
class DatmoComparison:
    """Reports of several methods on the same scans.

    Attributes:
        reports: Report of each method, by name.
    """

    reports: Mapping[str, DatmoReport]

    @property
    def frames(self) -> int:
        """Number of evaluated frames."""
        return next(iter(self.reports.values())).frames

    def tables(self) -> list[Table[Any]]:
        """Return the metrics with methods as rows, then the objects of each method."""
        title = "False tracks, and errors of matched tracks (medians; extent: means)"
        return [
            *self._mot_tables(),
            Table(title, _TRACK_COLUMNS, self.reports),
            *(_object_table(method, report) for method, report in self.reports.items()),
        ]

    def _mot_tables(self) -> list[Table[Any]]:
        protocol = next(iter(self.reports.values())).protocol
        within_m = protocol.targets.max_distance_m * (1 - protocol.distance_threshold)
        tight, loose = protocol.overlap_threshold, protocol.loose_overlap_threshold
        where = "on the ground plane; CLEAR and identity"
        return [
            mot_table(
                f"By distance of the centres {where} within {within_m:g} m; ratios in percent",
                {method: report.by_distance for method, report in self.reports.items()},
            ),
            mot_table(
                f"By overlap {where} at IoU {tight:g}; ratios in percent",
                {method: report.by_overlap for method, report in self.reports.items()},
            ),
            mot_table(
                f"By overlap {where} at IoU {loose:g}; ratios in percent",
                {method: report.by_loose_overlap for method, report in self.reports.items()},
            ),
        ]

    def to_json(self) -> dict[str, Any]:
        """Return all metrics by method."""
        return {method: _report_json(report) for method, report in self.reports.items()}


def _object_table(method: str, report: DatmoReport) -> Table[ObjectSummary]:
    kind = Column[ObjectSummary]("type", lambda s: report.types.get(s.object_id))
    rows = {str(summary.object_id): summary for summary in report.objects}
    title = f"Objects that must be tracked: {method}"
    return Table(title, (kind, *_OBJECT_COLUMNS), rows, heading="object")


def _report_json(report: DatmoReport) -> dict[str, Any]:
    return {
        "frames": report.frames,
        "duration_s": report.duration_s,
        "by_distance": report.by_distance.to_json(),
        "by_overlap": report.by_overlap.to_json(),
        "by_loose_overlap": report.by_loose_overlap.to_json(),
        "errors": report.errors,
        "never_tracked": report.never_tracked,
        "false_tracks": report.false_tracks,
        "objects": [
            {
                **dataclasses.asdict(summary),
                "type": report.types.get(summary.object_id),
                "share": summary.share,
            }
            for summary in report.objects
        ],
        "ms_per_frame": report.time_ms(),
        "ms_per_frame_p99": report.time_ms(0.99),
    }


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
            frames=len(self._similarities),
            duration_s=duration_s,
            by_distance=evaluate_tracks(by_distance, protocol.distance_threshold),
            by_overlap=evaluate_tracks(by_overlap, protocol.overlap_threshold),
            by_loose_overlap=evaluate_tracks(by_overlap, protocol.loose_overlap_threshold),
            errors=track_errors(errors),
            objects=summarise_objects(errors),
            types=self._truth.types(),
            false_tracks=find_false_tracks(TrackOutcomes.concatenate(self._outcomes), duration_s),
            seconds=np.array(self._seconds, np.float64),
        )


def _duration_s(stamps_s: Sequence[float]) -> float:
    """Return the duration of all frames, the last as long as the others on average."""
    if len(stamps_s) < 2:
        return 0.0
    return (stamps_s[-1] - stamps_s[0]) * len(stamps_s) / (len(stamps_s) - 1)
