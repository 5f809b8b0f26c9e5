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
from dataclasses import dataclass, field
from itertools import compress
from typing import Annotated, Any, Protocol

import numpy as np

from perception.evaluation.config import DatmoProtocol
from perception.evaluation.confusion import Confusion, add_confusions
from perception.evaluation.multi_object import track_assignment
from perception.evaluation.multi_object.mot_metrics import MotMetrics, evaluate_tracks, mot_table
from perception.evaluation.multi_object.sequence import TrackedFrame
from perception.evaluation.multi_object.track_assignment import (
    MovingScene,
    assign_tracks,
    similarity_by_distance,
    tracked_frame,
)
from perception.evaluation.multi_object.track_errors import (
    FalseTracks,
    MatchedErrors,
    TargetErrors,
    TrackedShare,
    TrackOutcomes,
    find_false_tracks,
    target_errors,
    track_outcomes,
)
from perception.evaluation.objects import length_classes
from perception.evaluation.obstacle_counts import ObstacleCounts, ObstacleSequence
from perception.evaluation.obstacles import motion_by_length
from perception.evaluation.pose_intervals import PoseMetrics
from perception.evaluation.report import CONTEXT, TOTAL, Metric, Metrics, Report, Table, with_total
from perception.geometry.box_overlap import iou_bev
from perception.types import Frame, Labels, PointTruth, Result

PROTOCOL_WORDS = {"tracks": track_assignment.__doc__, "metrics": __doc__}


@dataclass(frozen=True)
class LengthMetrics(Metrics):
    """Tracks and moving points of the objects of a class of lengths.

    Attributes:
        objects: Number of objects that must be tracked.
        never_tracked: Number of these that no track ever matched.
        ids_per_object: Mean number of different tracks that match one of the others while it moves; NaN without any.
        moving_iou: IoU of the points classified as moving with those that move, of all objects; NaN without exact
            truth of points.
    """

    objects: Annotated[int, Metric("objects")]
    never_tracked: Annotated[int, Metric("never tracked")]
    ids_per_object: Annotated[float, Metric("ids/object", ".2f")]
    moving_iou: Annotated[float, Metric("moving IoU", ".3f")]

    @classmethod
    def of(cls, objects: Sequence[TrackedShare], points: Confusion) -> "LengthMetrics":
        """Return the metrics of objects and of their points."""
        ids = [one.tracks for one in objects if one.frames_tracked]
        mean = float(np.mean(ids)) if ids else float("nan")
        return cls(len(objects), len(objects) - len(ids), mean, points.iou)


class MovingObjectTruth(Protocol):
    """Moving objects of a drive, frame by frame."""

    def scene(self, frame: Frame, clearance_m: float) -> MovingScene | None:
        """Return the objects of a frame, or None where its labels have no pose."""
        ...

    def types(self) -> dict[int, str]:
        """Return the class name of every object by track id."""
        ...


@dataclass(frozen=True)
class DatmoReport(Report):
    """Metrics of the tracks of one method on one drive.

    Attributes:
        protocol: Protocol of the evaluation.
        duration_s: Duration of the evaluated frames in s.
        by_distance: Metrics by distance of the centres.
        by_overlap: Metrics by overlap of the outlines.
        by_loose_overlap: Metrics by overlap with CLEAR and identity at the loose threshold.
        errors: Errors of matched tracks.
        objects: Tracking of each object that must be tracked, by its track id.
        by_length: Tracks and moving points of the objects, by their length.
        never_tracked: Track ids of the objects that no track ever matched.
        false_tracks: Tracks that match no moving object.
        frames: Number of evaluated frames.
        ms_per_frame: Mean time of detection and tracking; NaN without a frame.
        ms_p99: 99th percentile of the same time.
    """

    protocol: Annotated[DatmoProtocol, CONTEXT]
    duration_s: float
    by_distance: MotMetrics
    by_overlap: MotMetrics
    by_loose_overlap: MotMetrics
    errors: MatchedErrors
    objects: Mapping[str, TrackedShare]
    by_length: Mapping[str, LengthMetrics]
    never_tracked: list[int]
    false_tracks: FalseTracks
    frames: Annotated[int, Metric("frames")]
    ms_per_frame: Annotated[float, Metric("mean [ms]", ".1f")]
    ms_p99: Annotated[float, Metric("p99 [ms]", ".1f")]

    @property
    def count_never_tracked(self) -> Annotated[int, Metric("objects never tracked")]:
        """Number of objects that no track ever matched."""
        return len(self.never_tracked)


@dataclass(frozen=True)
class DatmoComparison(Report):
    """Reports of several methods on the same scans.

    Attributes:
        reports: Report of each method, by name.
        poses: Errors of the poses by the time since the first scan; none where exact poses are not known.
    """

    reports: Mapping[str, DatmoReport]
    poses: Mapping[str, PoseMetrics] = field(default_factory=dict)

    def tables(self) -> list[Table[Any]]:
        """Return the metrics with methods as rows, then the objects of each method."""
        reports = self.reports
        protocol = next(iter(reports.values())).protocol
        within_m = protocol.targets.max_distance_m * (1 - protocol.distance_threshold)
        where, unit = "on the ground plane; CLEAR and identity", "ratios in percent"
        distance = f"By distance of the centres {where} within {within_m:g} m; {unit}"
        overlap = f"By overlap {where} at IoU {protocol.overlap_threshold:g}; {unit}"
        loose = f"By overlap {where} at IoU {protocol.loose_overlap_threshold:g}; {unit}"
        errors = "Errors of matched tracks (medians; extent: means)"
        return [
            mot_table(distance, {name: one.by_distance for name, one in reports.items()}),
            mot_table(overlap, {name: one.by_overlap for name, one in reports.items()}),
            mot_table(loose, {name: one.by_loose_overlap for name, one in reports.items()}),
            Table(errors, MatchedErrors.columns(), {n: one.errors for n, one in reports.items()}),
            Table(
                "False tracks",
                FalseTracks.columns(),
                {name: one.false_tracks for name, one in reports.items()},
            ),
            Table("Objects that no track matched, and time", DatmoReport.columns(), reports),
            *self._of_poses,
            *(
                Table(f"By length of the object: {name}", LengthMetrics.columns(), one.by_length)
                for name, one in reports.items()
            ),
            *(
                Table(
                    f"Objects that must be tracked: {name}",
                    TrackedShare.columns(),
                    one.objects,
                    heading="object",
                )
                for name, one in reports.items()
            ),
        ]

    def to_json(self) -> dict[str, Any]:
        """Return all metrics by method."""
        document: dict[str, Any] = {name: one.to_json() for name, one in self.reports.items()}
        if self.poses:
            document["poses"] = {name: one.to_json() for name, one in self.poses.items()}
        return document

    @property
    def _of_poses(self) -> list[Table[PoseMetrics]]:
        if not self.poses:
            return []
        title = "Poses since the first scan (medians)"
        return [Table(title, PoseMetrics.columns(), self.poses, heading="time")]


@dataclass(frozen=True)
class DatmoSetReport(Report):
    """Reports of several methods on several sequences.

    Attributes:
        sequences: Reports of the methods on each sequence, by its name.
        printed: Sequences of the set as the thesis prints them.
    """

    sequences: Mapping[str, DatmoComparison]
    printed: Sequence[ObstacleSequence]

    @property
    def by_method(self) -> dict[str, dict[str, MotMetrics]]:
        """Metrics by distance of the centres by method, then by sequence and of all together."""
        methods = next(iter(self.sequences.values())).reports
        return {
            method: with_total(
                {name: one.reports[method].by_distance for name, one in self.sequences.items()}
            )
            for method in methods
        }

    def tables(self) -> list[Table[Any]]:
        """Return the metrics of each method by sequence, and the moving obstacles of Table 7.2."""
        tables: list[Table[Any]] = []
        for method, rows in self.by_method.items():
            title = f"{method}: by distance of the centres on the ground plane; ratios in percent"
            tables.append(mot_table(title, rows))
            title = f"{method}: moving objects once per frame, in the columns of Table 7.2"
            tables.append(_moving_table(title, {n: moving_counts(one) for n, one in rows.items()}))
        return [*tables, self._printed]

    def to_json(self) -> dict[str, Any]:
        """Return all metrics by sequence and by method, those of all sequences, and the printed counts."""
        return {
            "sequences": {name: one.to_json() for name, one in self.sequences.items()},
            "total": {method: rows[TOTAL].to_json() for method, rows in self.by_method.items()},
            "thesis": self._printed.to_json(),
        }

    @property
    def _printed(self) -> Table[ObstacleCounts]:
        title = "Thesis, Table 7.2: moving obstacles in 25 scans of each sequence, by a person"
        return _moving_table(title, with_total({row.name: row.printed for row in self.printed}))


def _moving_table(title: str, rows: Mapping[str, ObstacleCounts]) -> Table[ObstacleCounts]:
    """Return the columns of moving obstacles."""
    columns = [column for column in ObstacleCounts.columns() if "moving" in column.name]
    return Table(title, columns, rows, heading="sequence")


def moving_counts(metrics: MotMetrics) -> ObstacleCounts:
    """Return the moving objects that must be tracked, those without a track, and the tracks without an object."""
    clear = metrics.clear
    return ObstacleCounts(
        moving=clear.true_positives + clear.false_negatives,
        missed_moving=clear.false_negatives,
        false_moving=clear.false_positives,
    )


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
        self._by_distance: list[TrackedFrame] = []
        self._by_overlap: list[TrackedFrame] = []
        self._errors: list[TargetErrors] = []
        self._outcomes: list[TrackOutcomes] = []
        self._points: dict[str, Confusion] = {}

    def update(
        self, result: Result, labels: Labels | None = None, truth: PointTruth | None = None
    ) -> None:
        """Add one frame; a frame whose labels have no pose is left out.

        Args:
            result: Frame with its tracks and with the time of the stage `moving objects`.
            labels: Not read: the moving objects of the drive are used.
            truth: Exact truth of every point, with which moving points are compared, or None.
        """
        frame, tracks, targets = result.frame, result.tracks, self._protocol.targets
        scene = self._truth.scene(frame, targets.clearance_m)
        if scene is None:
            return
        assignment = assign_tracks(scene, tracks, targets)
        by_distance = similarity_by_distance(targets)
        self._stamps_s.append(frame.stamp_s)
        self._seconds.append(result.timings_s.get("moving objects", np.nan))
        self._by_distance.append(tracked_frame(scene, tracks, assignment, by_distance))
        self._by_overlap.append(tracked_frame(scene, tracks, assignment, iou_bev))
        self._errors.append(target_errors(frame.stamp_s, scene, tracks, assignment))
        self._outcomes.append(track_outcomes(tracks, assignment))
        if truth is not None:
            states, objects = result.obstacles.point_states, scene.objects
            points = motion_by_length(states, truth, objects.boxes_velo, objects.track_ids)
            self._points = add_confusions(self._points, points)

    def compute(self) -> DatmoReport:
        """Return the metrics of all frames so far."""
        protocol, errors = self._protocol, TargetErrors.concatenate(self._errors)
        duration_s, types = _duration_s(self._stamps_s), self._truth.types()
        objects = {
            str(number): rows.of_object(types.get(number))
            for number, rows in errors.by_object().items()
        }
        lengths_m = np.array([one.length_m for one in objects.values()], np.float64)
        by_length = {
            name: LengthMetrics.of(
                [*compress(objects.values(), is_of_class)], self._points.get(name, Confusion())
            )
            for name, is_of_class in length_classes(lengths_m).items()
            if is_of_class.any()
        }
        ms = 1e3 * np.array(self._seconds or [np.nan])
        return DatmoReport(
            protocol,
            duration_s,
            by_distance=evaluate_tracks(self._by_distance, protocol.distance_threshold),
            by_overlap=evaluate_tracks(self._by_overlap, protocol.overlap_threshold),
            by_loose_overlap=evaluate_tracks(self._by_overlap, protocol.loose_overlap_threshold),
            errors=errors.summary(),
            objects=objects,
            by_length=by_length,
            never_tracked=[int(n) for n, one in objects.items() if not one.frames_tracked],
            false_tracks=find_false_tracks(TrackOutcomes.concatenate(self._outcomes), duration_s),
            frames=len(self._seconds),
            ms_per_frame=float(ms.mean()),
            ms_p99=float(np.quantile(ms, 0.99)),
        )


def _duration_s(stamps_s: Sequence[float]) -> float:
    """Return the duration of all frames, the last as long as the others on average."""
    if len(stamps_s) < 2:
        return 0.0
    return (stamps_s[-1] - stamps_s[0]) * len(stamps_s) / (len(stamps_s) - 1)
