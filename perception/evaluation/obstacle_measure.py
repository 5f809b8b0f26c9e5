"""Metrics of the obstacles of a drive: objects missed, false moving clusters, shadows, and points where truth is exact."""

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from perception.evaluation import false_clusters, obstacles, shadows
from perception.evaluation.config import ObstacleProtocol
from perception.evaluation.confusion import confusion_table
from perception.evaluation.false_clusters import (
    MovingClusters,
    is_false,
    moving_clusters,
)
from perception.evaluation.objects import (
    FrameAnnotations,
    LabelledObjects,
    LabelledView,
    MotionState,
)
from perception.evaluation.obstacles import (
    ObjectCounts,
    ObjectObservations,
    PointMotion,
    count_objects,
    missed_moving,
    observe_objects,
    point_motion,
)
from perception.evaluation.report import Column, Table
from perception.evaluation.shadows import ShadowDetector, Shadows
from perception.geometry.grids import LocalArea
from perception.types import Int, Labels, PointTruth, Result

PROTOCOL_WORDS = {
    "objects": obstacles.__doc__,
    "false_clusters": false_clusters.__doc__,
    "shadows": shadows.__doc__,
}


class MotionTruth(Protocol):
    """Motion of the labelled objects of a drive."""

    def of(self, frame: int, track_ids: Int) -> Int:
        """Return (M,) the `MotionState` of each track in a frame."""
        ...


_Counts = Column[ObjectCounts]
_OBJECT_COLUMNS = (
    _Counts("objects", lambda c: c.objects, "", "objects"),
    _Counts("missed", lambda c: c.missed_objects, "", "missed_objects"),
    _Counts(
        "missed [%]", lambda c: 100 * c.missed_objects / c.objects if c.objects else None, ".1f"
    ),
    _Counts("moving", lambda c: c.moving, "", "moving"),
    _Counts("found static", lambda c: c.missed_moving, "", "missed_moving"),
    _Counts("tracks", lambda c: c.moving_tracks, "", "moving_tracks"),
    _Counts("never moving", lambda c: c.tracks_never_moving, "", "tracks_never_moving"),
    _Counts("static", lambda c: c.static, "", "static"),
    _Counts("found moving", lambda c: c.false_moving, "", "false_moving"),
)


@dataclass(frozen=True)
class ObstacleReport:
    """Metrics of the obstacles of one drive.

    Attributes:
        protocol: Protocol of the evaluation.
        frames: Number of evaluated frames.
        observed: Labelled objects of all frames, or None without labels.
        clusters: Moving clusters, or None where labels and INS do not state what moves, or where no
            camera's view was labelled.
        shadows: False static obstacles, or None as with the clusters.
        points: Confusion of points, or None without exact truth.
        has_motion: Whether labels and INS state what moves.
    """

    protocol: ObstacleProtocol
    frames: int
    observed: ObjectObservations | None
    clusters: MovingClusters | None
    shadows: Shadows | None
    points: PointMotion | None
    has_motion: bool

    def counts(self) -> ObjectCounts:
        """Count objects under the protocol's thresholds."""
        return count_objects(self.observed or ObjectObservations.empty(), self.protocol.objects)

    def missing(self) -> str | None:
        """Name the metrics that the drive does not allow."""
        if self.observed is None:
            return "No object metrics: the drive has no labelled boxes."
        if not self.has_motion:
            return "No motion of objects: it takes labels with track ids, and INS poses."
        if self.clusters is None:
            return "No false moving clusters: it takes images to know the camera's view."
        return None

    def tables(self) -> list[Table[Any]]:
        """Return objects by three criteria, false clusters, shadows, and points against exact truth."""
        tables: list[Table[Any]] = []
        if self.observed is not None:
            tables += self._object_tables(self.observed)
        if self.clusters is not None:
            tables.append(self._cluster_table(self.clusters))
        if self.shadows is not None:
            tables.append(_shadow_table(self.shadows))
        if self.points is not None:
            points = {"moving": self.points.moving, "static": self.points.static}
            tables.append(confusion_table("Moving and static points against exact truth", points))
        if (missing := self.missing()) is not None and tables:
            tables[-1] = replace(tables[-1], notes=("", missing))
        return tables

    def _object_tables(self, observed: ObjectObservations) -> list[Table[Any]]:
        """Return objects by number of points, by required share of moving points, and by frames."""
        protocol, config = self.protocol, self.protocol.objects
        sizes = sorted({config.min_points, *protocol.other_min_points})
        shares = sorted({config.moving_share, *protocol.other_moving_shares})
        warms_up = np.asarray(observed.frames < protocol.warm_up)
        by_points = {
            f"{size} points and more": count_objects(observed, replace(config, min_points=size))
            for size in sizes
        }
        by_share = {
            f"{100 * share:g} %" if share else "any": count_objects(
                observed, replace(config, moving_share=share)
            )
            for share in shares
        }
        by_frames = {
            f"first {protocol.warm_up}": count_objects(observed[warms_up], config),
            "all others": count_objects(observed[~warms_up], config),
        }
        over = f"Labelled objects of {config.min_points} points and more"
        found = f"found moving at {100 * config.moving_share:g} % moving points"
        return [
            Table(f"Labelled objects, once per frame; {found}", _OBJECT_COLUMNS, by_points),
            Table(f"{over}, by required share of moving points", _OBJECT_COLUMNS, by_share),
            Table(f"{over}, by frames", _OBJECT_COLUMNS, by_frames),
        ]

    def _false(self, clusters: MovingClusters) -> MovingClusters:
        return clusters[is_false(clusters, 1, self.protocol.clusters, ignore_dont_care=True)]

    def _cluster_table(self, clusters: MovingClusters) -> Table[MovingClusters]:
        protocol, static = self.protocol, MotionState.STATIC
        everywhere = is_false(clusters, 1, protocol.clusters, ignore_dont_care=False)
        sizes = sorted({protocol.cluster_points, *protocol.other_cluster_points})
        rows = {
            f"{size} points and more": clusters[everywhere & (clusters.points >= size)]
            for size in sizes
        }
        false, first = self._false, protocol.warm_up
        columns = (
            _Clusters("clusters", lambda c: len(false(c)), "", "clusters"),
            _Clusters("/scan", lambda c: len(false(c)) / self.frames, ".3f", "per_frame"),
            _Clusters(
                "on static objects",
                lambda c: int(np.count_nonzero(false(c).object_motions == static)),
                "",
                "on_static_objects",
            ),
            _Clusters(
                f"in first {first}",
                lambda c: int(np.count_nonzero(false(c).frames < first)),
                "",
                "in_warm_up",
            ),
            _Clusters("with DontCare", len, "", "with_dont_care"),
        )
        return Table("False moving clusters in the camera's view", columns, rows)

    def to_json(self) -> dict[str, Any]:
        """Return all counts by name, and the objects and clusters that count as errors."""
        document: dict[str, Any] = {"missing": self.missing()}
        if self.observed is not None:
            by_points, by_share, by_frames = self._object_tables(self.observed)
            document["objects"] = self.counts()
            document["objects_by_min_points"] = by_points.to_json()
            document["objects_by_moving_share"] = by_share.to_json()
            document["objects_by_frames"] = by_frames.to_json()
            document["missed_moving"] = missed_moving(self.observed, self.protocol.objects)
        if self.clusters is not None:
            large = self.clusters[self.clusters.points >= self.protocol.cluster_points]
            document["false_clusters"] = self._cluster_table(self.clusters).to_json()
            document["false_cluster_positions"] = self._false(large)
        if self.shadows is not None:
            document["shadows"] = _shadow_table(self.shadows).to_json()
        if self.points is not None:
            document["points_moving"] = self.points.moving.to_json()
            document["points_static"] = self.points.static.to_json()
        return document


_Clusters = Column[MovingClusters]


def _shadow_table(shadows: Shadows) -> Table[Int]:
    columns = (
        Column[Int]("all", lambda counts: int(counts.sum()), "", "all"),
        Column[Int]("/scan", lambda counts: float(counts.mean()), ".3f", "per_frame"),
    )
    rows = {"shadows": shadows.clusters, "voxels in them": shadows.voxels}
    title = "False static obstacles: shadows of moving objects, in the camera's view"
    return Table(title, columns, rows)


class ObstacleMeasure:
    """Accumulates objects, false clusters, shadows and points over the frames of a drive."""

    def __init__(
        self,
        area: LocalArea,
        protocol: ObstacleProtocol | None = None,
        motion: MotionTruth | None = None,
    ) -> None:
        """Start without a frame.

        Args:
            area: Area over which objects and points count.
            protocol: Protocol of the evaluation.
            motion: Motion of the labelled objects, or None where it is unknown.
        """
        self._area, self._protocol, self._motion = area, protocol or ObstacleProtocol(), motion
        self._shadow_detector = ShadowDetector(self._protocol.shadows)
        self._observed: list[ObjectObservations] = []
        self._clusters: list[MovingClusters] = []
        self._shadows: list[Shadows] = []
        self._points: list[PointMotion] = []
        self._frames = 0

    def update(self, result: Result, labels: Labels | None, truth: PointTruth | None) -> None:
        """Add one frame."""
        self._frames += 1
        if labels is not None:
            self._add_objects(result, labels)
        if truth is not None:
            states = result.obstacles.point_states
            self._points.append(point_motion(states, truth.classes, truth.is_moving))

    def _add_objects(self, result: Result, labels: Labels) -> None:
        index, scan = result.frame.index, result.frame.points_velo
        states, protocol = result.obstacles.point_states, self._protocol
        objects = self._labelled_objects(index, labels)
        self._observed.append(
            observe_objects(index, scan, states, objects, self._area, protocol.objects)
        )
        view = LabelledView.of(result.frame, labels.dont_care_px)
        if self._motion is not None and view is not None:
            annotations = FrameAnnotations(objects, view)
            self._clusters.append(
                moving_clusters(index, scan, states, annotations, protocol.clusters)
            )
            self._shadows.append(self._shadow_detector.update(result, annotations))

    def _labelled_objects(self, index: int, labels: Labels) -> LabelledObjects:
        unknown = np.full(len(labels), MotionState.UNKNOWN, np.int64)
        motions = unknown if self._motion is None else self._motion.of(index, labels.track_ids)
        return LabelledObjects(labels.boxes_velo, motions, labels.track_ids)

    def compute(self) -> ObstacleReport:
        """Return the metrics of all frames so far."""
        return ObstacleReport(
            protocol=self._protocol,
            frames=self._frames,
            observed=ObjectObservations.concatenate(self._observed) if self._observed else None,
            clusters=MovingClusters.concatenate(self._clusters) if self._clusters else None,
            shadows=Shadows.concatenate(self._shadows) if self._shadows else None,
            points=sum(self._points, PointMotion()) if self._points else None,
            has_motion=self._motion is not None,
        )
