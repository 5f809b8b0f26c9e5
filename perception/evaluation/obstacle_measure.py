"""Metrics of the obstacles of a drive: objects missed, false moving clusters, shadows, and points where truth is exact."""

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from perception.evaluation.config import ObjectMatchConfig, ObstacleProtocol
from perception.evaluation.confusion import confusion_table
from perception.evaluation.false_clusters import (
    FrameAnnotations,
    MovingClusters,
    is_false,
    moving_clusters,
)
from perception.evaluation.objects import LabelledObjects, MotionState
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
from perception.types import Frame, Int, Labels, PointTruth, Result

PROTOCOL_WORDS = {
    "objects": (
        "an object counts in a frame when its box's bottom centre is in the local area and its box holds "
        "min_points points from clearance_m above its bottom to the area's height; it is found as an "
        "obstacle when found_share of them are static or moving, and to move when moving_share of those "
        "are moving; a static object found to move is false; objects of unknown motion count as "
        "obstacles only"
    ),
    "motion": (
        "an object moves while its box travels over the ground, by label boxes and INS poses, with "
        "hysteresis; unknown without INS"
    ),
    "false_clusters": (
        "moving points in cells of the ground plane, closed and joined over eight neighbours; false where "
        "view_share of a cluster is in the image and none of its points within margin_m of an object "
        "that moves or whose motion is unknown; with and without those half in DontCare regions; "
        "at the object protocol's min_points or other sizes"
    ),
    "shadows": (
        "static voxels, in view, where a labelled moving object was within memory_s and no labelled "
        "object is now: false static obstacles"
    ),
    "points": (
        "points classified as moving against points of objects that move, points classified as static "
        "against all others above the ground; labelled points below the area's height, summed over "
        "frames; points less than the clearance over the ground are classified as ground by design"
    ),
}


class MotionTruth(Protocol):
    """Motion of the labelled objects of a drive."""

    def of(self, frame: int, track_ids: Int) -> Int:
        """Return (M,) the `MotionState` of each track in a frame."""
        ...


@dataclass(frozen=True)
class FalseClusters:
    """Numbers of moving clusters that no labelled object explains.

    Attributes:
        min_points: Number of points of the smallest cluster that counts.
        clusters: Number of clusters in the camera's view and outside DontCare regions.
        on_static_objects: Number of these clusters on a labelled static object.
        in_warm_up: Number of these clusters in the first frames, in which motion has no history.
        with_dont_care: Number of clusters when those in DontCare regions count too.
        per_frame: Number of clusters per evaluated frame.
    """

    min_points: int
    clusters: int
    on_static_objects: int
    in_warm_up: int
    with_dont_care: int
    per_frame: float


_OBJECT_COLUMNS = (
    Column[ObjectCounts]("objects", lambda c: c.objects, "", "objects"),
    Column[ObjectCounts]("missed", lambda c: c.missed_objects, "", "missed_objects"),
    Column[ObjectCounts]("missed [%]", lambda c: _percent(c.missed_objects, c.objects), ".1f"),
    Column[ObjectCounts]("moving", lambda c: c.moving, "", "moving"),
    Column[ObjectCounts]("found static", lambda c: c.missed_moving, "", "missed_moving"),
    Column[ObjectCounts]("tracks", lambda c: c.moving_tracks, "", "moving_tracks"),
    Column[ObjectCounts](
        "never moving", lambda c: c.tracks_never_moving, "", "tracks_never_moving"
    ),
    Column[ObjectCounts]("static", lambda c: c.static, "", "static"),
    Column[ObjectCounts]("found moving", lambda c: c.false_moving, "", "false_moving"),
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

    def counts(self, config: ObjectMatchConfig | None = None) -> ObjectCounts:
        """Count objects under the protocol's thresholds, or under others."""
        observed = self.observed or ObjectObservations.concatenate([])
        return count_objects(observed, config or self.protocol.objects)

    def counts_by_min_points(self) -> dict[str, ObjectCounts]:
        """Count objects that hold different numbers of points."""
        config = self.protocol.objects
        sizes = sorted({config.min_points, *self.protocol.other_min_points})
        return {
            f"{size} points and more": self.counts(replace(config, min_points=size))
            for size in sizes
        }

    def counts_by_moving_share(self) -> dict[str, ObjectCounts]:
        """Count objects under different shares of points that must move."""
        config = self.protocol.objects
        shares = sorted({config.moving_share, *self.protocol.other_moving_shares})
        return {
            f"{100 * share:g} %" if share else "any": self.counts(
                replace(config, moving_share=share)
            )
            for share in shares
        }

    def counts_by_warm_up(self) -> dict[str, ObjectCounts]:
        """Count the objects of the first frames and those of all others."""
        if self.observed is None:
            return {}
        warms_up = np.asarray(self.observed.frames < self.protocol.warm_up)
        groups = {f"first {self.protocol.warm_up}": warms_up, "all others": ~warms_up}
        return {
            name: count_objects(self.observed[rows], self.protocol.objects)
            for name, rows in groups.items()
        }

    def false_clusters(self) -> dict[str, FalseClusters]:
        """Count false moving clusters of different sizes."""
        if self.clusters is None:
            return {}
        sizes = sorted({self.protocol.cluster_points, *self.protocol.other_cluster_points})
        return {f"{size} points and more": self._false(self.clusters, size) for size in sizes}

    def _false(self, clusters: MovingClusters, size: int) -> FalseClusters:
        config = self.protocol.clusters
        false = clusters[is_false(clusters, size, config, ignore_dont_care=True)]
        everywhere = is_false(clusters, size, config, ignore_dont_care=False)
        return FalseClusters(
            min_points=size,
            clusters=len(false),
            on_static_objects=int(np.count_nonzero(false.object_motions == MotionState.STATIC)),
            in_warm_up=int(np.count_nonzero(false.frames < self.protocol.warm_up)),
            with_dont_care=int(np.count_nonzero(everywhere)),
            per_frame=len(false) / self.frames if self.frames else float("nan"),
        )

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
        tables = [*self._object_tables(), *self._cluster_tables(), *self._shadow_tables()]
        if self.points is not None:
            points = {"moving": self.points.moving, "static": self.points.static}
            tables.append(confusion_table("Moving and static points against exact truth", points))
        if (missing := self.missing()) is not None and tables:
            tables[-1] = replace(tables[-1], notes=("", missing))
        return tables

    def _object_tables(self) -> list[Table[Any]]:
        if self.observed is None:
            return []
        config = self.protocol.objects
        over = f"Labelled objects of {config.min_points} points and more"
        share = f"{100 * config.moving_share:g} %"
        return [
            Table(
                f"Labelled objects, once per frame; found moving at {share} moving points",
                _OBJECT_COLUMNS,
                self.counts_by_min_points(),
            ),
            Table(
                f"{over}, by required share of moving points",
                _OBJECT_COLUMNS,
                self.counts_by_moving_share(),
            ),
            Table(f"{over}, by frames", _OBJECT_COLUMNS, self.counts_by_warm_up()),
        ]

    def _cluster_tables(self) -> list[Table[Any]]:
        if self.clusters is None:
            return []
        columns = (
            Column[FalseClusters]("clusters", lambda f: f.clusters),
            Column[FalseClusters]("/scan", lambda f: f.per_frame, ".3f"),
            Column[FalseClusters]("on static objects", lambda f: f.on_static_objects),
            Column[FalseClusters](f"in first {self.protocol.warm_up}", lambda f: f.in_warm_up),
            Column[FalseClusters]("with DontCare", lambda f: f.with_dont_care),
        )
        return [Table("False moving clusters in the camera's view", columns, self.false_clusters())]

    def _shadow_tables(self) -> list[Table[Any]]:
        if self.shadows is None:
            return []
        columns = (
            Column[Int]("all", lambda counts: int(counts.sum())),
            Column[Int]("/scan", lambda counts: float(counts.mean()), ".3f"),
        )
        rows = {"shadows": self.shadows.clusters, "voxels in them": self.shadows.voxels}
        title = "False static obstacles: shadows of moving objects, in the camera's view"
        return [Table(title, columns, rows)]

    def to_json(self) -> dict[str, Any]:
        """Return all counts by name, and the objects and clusters that count as errors."""
        document: dict[str, Any] = {"missing": self.missing()}
        if self.observed is not None:
            by_min_points, by_share, by_frames = (
                table.to_json() for table in self._object_tables()
            )
            document["objects"] = self.counts()
            document["objects_by_min_points"] = by_min_points
            document["objects_by_moving_share"] = by_share
            document["objects_by_frames"] = by_frames
            document["missed_moving"] = missed_moving(self.observed, self.protocol.objects)
        if self.clusters is not None:
            protocol = self.protocol
            false = is_false(
                self.clusters, protocol.cluster_points, protocol.clusters, ignore_dont_care=True
            )
            document["false_clusters"] = self.false_clusters()
            document["false_cluster_positions"] = self.clusters[false]
        if self.shadows is not None:
            document["shadows"] = int(self.shadows.clusters.sum())
            document["shadow_voxels"] = int(self.shadows.voxels.sum())
            document["shadows_per_frame"] = float(self.shadows.clusters.mean())
        if self.points is not None:
            document["points_moving"] = self.points.moving.to_json()
            document["points_static"] = self.points.static.to_json()
        return document


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
        annotations = _annotations(objects, labels, result.frame)
        if self._motion is not None and annotations is not None:
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


def _annotations(objects: LabelledObjects, labels: Labels, frame: Frame) -> FrameAnnotations | None:
    calibration = frame.calibration
    if calibration is None or calibration.image_size_px is None:
        return None
    return FrameAnnotations(objects, labels.dont_care_px, calibration, calibration.image_size_px)


def _percent(part: int, whole: int) -> float | None:
    return 100 * part / whole if whole else None
