"""Metrics of the obstacles of a drive: objects missed, false moving clusters, shadows, and points where truth is exact."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Protocol

import numpy as np

from perception.evaluation import (
    exact_obstacles,
    false_obstacles,
    moving_segmentation,
    obstacles,
)
from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.confusion import Confusion, add_confusions
from perception.evaluation.exact_obstacles import count_exactly
from perception.evaluation.false_obstacles import (
    MovingClusters,
    ShadowDetector,
    Shadows,
    moving_clusters,
)
from perception.evaluation.free_space import FreeSpaceCounts, count_free_space
from perception.evaluation.moving_segmentation import (
    MotionCounts,
    count_motion,
    speeds_of,
    truth_of_boxes,
)
from perception.evaluation.objects import LabelledObjects, LabelledView, MotionState
from perception.evaluation.obstacle_counts import ObstacleCounts
from perception.evaluation.obstacles import (
    FrameObstacles,
    ObjectCounts,
    ObjectObservations,
    count_objects,
    missed_moving,
    motion_by_length,
    motion_confusions,
    object_motions,
    observe_objects,
)
from perception.evaluation.report import CONTEXT, Metric, Metrics, Report, Table
from perception.geometry.grids import LocalArea
from perception.obstacles.occupancy import occupancy_grid
from perception.types import Float64, Int, Labels, PointTruth, Result

# Thresholds that are counted beside those of the protocol; a share of 0 asks for any point.
_OTHER_MIN_POINTS, _OTHER_MOVING_SHARES = (1, 5, 50), (0.0, 0.1, 0.5)
_CLUSTER_POINTS = (1, 5, 20)  # of the smallest cluster that counts; 5 is the thesis' T_d
_OF_OBJECTS = ("objects", "missed", "missed_share", "recall")
_WARM_UP = 1  # first frames, which are also counted apart, since motion needs a history

PROTOCOL_WORDS = {
    "objects": obstacles.__doc__,
    "false_obstacles": false_obstacles.__doc__,
    "exact_truth": exact_obstacles.__doc__,
    "moving_segmentation": moving_segmentation.__doc__,
    "points": (
        "points classified as moving against those that move (SemanticKITTI: classes 252 to 259), and those "
        "classified as static against all others off the ground, within the local area and below its height, "
        "summed over frames; unlabelled points and outliers do not count"
    ),
    "counts": (
        "the columns of Table 7.2 over the scans evaluated: by exact truth of points where there is any, else of "
        "labelled objects; false obstacles are shadows of moving objects, with exact truth also "
        "clusters of ground points; false moving are false moving clusters"
    ),
}


class MotionTruth(Protocol):
    """Motion of the labelled objects of a drive."""

    def of(self, frame: int, track_ids: Int) -> Int:
        """Return (M,) the `MotionState` of each track in a frame."""
        ...

    def velocities_of(self, frame: int, track_ids: Int) -> Float64:
        """Return the (M, 2) velocities of tracks in a frame, NaN where they have no box."""
        ...


@dataclass(frozen=True)
class FalseClusterCounts(Metrics):
    """Numbers of false moving clusters in the camera's view.

    Attributes:
        clusters: Number of false clusters without those in DontCare regions.
        per_frame: Number of these clusters per frame.
        on_static_objects: Number of these clusters on labelled static objects.
        in_warm_up: Number of these clusters in the first frames.
        with_dont_care: Number of false clusters, with those in DontCare regions.
    """

    clusters: Annotated[int, Metric("clusters")]
    per_frame: Annotated[float, Metric("/scan", ".3f")]
    on_static_objects: Annotated[int, Metric("on static objects")]
    in_warm_up: Annotated[int, Metric("in first frames")]
    with_dont_care: Annotated[int, Metric("with DontCare")]


@dataclass(frozen=True)
class ShadowCounts(Metrics):
    """Number of shadows, or of the voxels in them.

    Attributes:
        all: Number in all frames.
        per_frame: Number per frame.
    """

    all: Annotated[int, Metric("all")]
    per_frame: Annotated[float, Metric("/scan", ".3f")]

    @classmethod
    def of(cls, counts: Int) -> "ShadowCounts":
        """Sum the (F,) counts of all frames."""
        return cls(int(counts.sum()), float(counts.mean()))


@dataclass(frozen=True)
class ObstacleReport(Report):
    """Metrics of the obstacles of one drive; what the drive does not allow is None or empty.

    Attributes:
        config: Thresholds at which an object counts and is found.
        missing: Metrics that the drive does not allow, in words.
        counts: Obstacles in the columns of Table 7.2, by frame.
        is_exact: Whether these are counted by exact truth of points, rather than by labels.
        object_motions: Motion of each labelled object that enters the area: moving where it moves in any frame.
        moving_segmentation: Moving points and objects all around, of all speeds and of each class of speeds.
        objects: Labelled objects under the protocol's thresholds.
        objects_by_min_points: Labelled objects by the number of points that they must hold.
        objects_by_moving_share: Labelled objects by the required share of moving points.
        objects_by_frames: Labelled objects of the first frames, and of all others.
        missed_moving: Moving objects that were not found to move.
        false_clusters: False moving clusters by their minimum number of points.
        shadows: Shadows of moving objects, and the voxels in them.
        points_moving: Confusion of moving points against exact truth.
        points_static: Confusion of static points against exact truth.
        points_by_length: Confusion of moving points of labelled objects against exact truth, by the object's length.
        free_space: Cells of the occupancy grid against exact truth.
    """

    config: Annotated[ObjectMatchConfig, CONTEXT]
    missing: str | None
    counts: Annotated[Mapping[int, ObstacleCounts], CONTEXT] = field(default_factory=dict)
    is_exact: bool = False
    object_motions: Mapping[str, str] = field(default_factory=dict)
    moving_segmentation: Mapping[str, MotionCounts] = field(default_factory=dict)
    objects: ObjectCounts | None = None
    objects_by_min_points: Mapping[str, ObjectCounts] = field(default_factory=dict)
    objects_by_moving_share: Mapping[str, ObjectCounts] = field(default_factory=dict)
    objects_by_frames: Mapping[str, ObjectCounts] = field(default_factory=dict)
    missed_moving: ObjectObservations | None = None
    false_clusters: Mapping[str, FalseClusterCounts] = field(default_factory=dict)
    shadows: Mapping[str, ShadowCounts] = field(default_factory=dict)
    points_moving: Confusion | None = None
    points_static: Confusion | None = None
    points_by_length: Mapping[str, Confusion] = field(default_factory=dict)
    free_space: FreeSpaceCounts | None = None

    @property
    def title(self) -> str:
        """Title of the counts of Table 7.2."""
        truth = "by exact truth of points" if self.is_exact else "of labelled objects"
        return f"Obstacles in the columns of Table 7.2, {truth}"

    @property
    def total(self) -> ObstacleCounts:
        """Obstacles of all frames in the columns of Table 7.2."""
        return sum(self.counts.values(), ObstacleCounts())

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by name, without those that the data do not allow."""
        counts = {"counts": self.total.to_json()} if self.counts else {}
        return {**counts, **super().to_json()}

    def tables(self) -> list[Table[Any]]:
        """Return the columns of Table 7.2, objects by three criteria, false clusters, shadows, and exact points."""
        config, points = self.config, {"moving": self.points_moving, "static": self.points_static}
        found = f"found moving at {100 * config.moving_share:g} % moving points"
        over = f"Labelled objects of {config.min_points} points and more"
        view = "in the camera's view"
        shadows = f"False static obstacles: shadows of moving objects, {view}"
        exact = "Moving and static points against exact truth"
        objects, segmented = ObjectCounts.columns(), MotionCounts.columns()
        # False points and clusters have no speed.
        of_objects = [one for one in segmented if one.key in _OF_OBJECTS]
        by_speed = dict(self.moving_segmentation)
        everything = {"all": by_speed.pop("all")} if by_speed else {}
        # fmt: off
        tables: list[Table[Any]] = [
            Table(self.title, ObstacleCounts.columns(), {"all frames": self.total} if self.counts else {}),
            Table(f"Labelled objects, once per frame; {found}", objects, self.objects_by_min_points),
            Table(f"{over}, by required share of moving points", objects, self.objects_by_moving_share),
            Table(f"{over}, by frames", objects, self.objects_by_frames),
            Table(f"False moving clusters {view}", FalseClusterCounts.columns(), self.false_clusters),
            Table(shadows, ShadowCounts.columns(), self.shadows),
            Table(exact, Confusion.columns(), {n: one for n, one in points.items() if one is not None}),
            Table(f"{exact}: moving, by length of the object", Confusion.columns(), self.points_by_length),
            Table("Occupancy grid within 20 m, cells against exact truth", FreeSpaceCounts.columns(), {"all frames": self.free_space} if self.free_space else {}),
            Table("Moving objects and their points, by speed", of_objects, {n: one for n, one in by_speed.items() if one.objects}),
            Table("Moving object segmentation (MOS)", segmented, everything),
        ]
        # fmt: on
        tables = [table for table in tables if table.rows]
        if self.missing is not None and tables:
            tables[-1] = replace(tables[-1], notes=("", self.missing))
        return tables


class ObstacleMeasure:
    """Accumulates objects, false clusters, shadows and points over the frames of a drive."""

    def __init__(
        self,
        area: LocalArea,
        config: ObjectMatchConfig | None = None,
        motion: MotionTruth | None = None,
        *,
        is_labelled_around: bool = False,
    ) -> None:
        """Start without a frame.

        Args:
            area: Area over which objects and points count.
            config: Thresholds at which an object counts and is found.
            motion: Motion of the labelled objects, or None where it is unknown.
            is_labelled_around: Whether objects beside the camera's view are labelled, too.
        """
        self._is_labelled_around = is_labelled_around
        self._segmented: dict[str, MotionCounts] = {}
        self._area, self._config, self._motion = area, config or ObjectMatchConfig(), motion
        self._shadow_detector = ShadowDetector()
        self._observed: list[ObjectObservations] = []
        self._clusters: list[MovingClusters] = []
        self._shadows: list[Shadows] = []
        self._points: dict[str, Confusion] = {}
        self._by_length: dict[str, Confusion] = {}
        self._counted: dict[int, FrameObstacles] = {}
        self._free_space: FreeSpaceCounts | None = None
        self._is_exact = False
        self._frames = 0

    def update(self, result: Result, labels: Labels | None, truth: PointTruth | None) -> None:
        """Add one frame."""
        self._frames += 1
        counted = None if labels is None else self._add_objects(result, labels)
        if truth is not None:
            states = result.obstacles.point_states
            added = motion_confusions(states, truth.classes, truth.is_moving)
            self._points = add_confusions(self._points, added)
            if labels is not None:
                by_length = motion_by_length(states, truth, labels.boxes_velo, labels.track_ids)
                self._by_length = add_confusions(self._by_length, by_length)
            shadows = 0 if counted is None else counted.false_obstacles
            exact = count_exactly(result, truth, self._area, self._config)
            counted = replace(exact, false_obstacles=exact.false_obstacles + shadows)
            self._is_exact = True
            cells = count_free_space(result, occupancy_grid(result), truth, self._area)
            self._free_space = cells + (self._free_space or FreeSpaceCounts())
        self._add_motion(result, labels, truth)
        if counted is not None:
            self._counted[result.frame.index] = counted

    def obstacles_of(self, frame: int) -> FrameObstacles | None:
        """Return the obstacles of a frame in the columns of Table 7.2, or None where their motion is not known."""
        return self._counted.get(frame)

    def _add_motion(self, result: Result, labels: Labels | None, truth: PointTruth | None) -> None:
        """Add the moving points and objects of a frame, by the truth of its points, or of its boxes and their motion."""
        index, speeds_m_s = result.frame.index, {}
        if labels is not None and self._motion is not None:
            ids = labels.track_ids
            speeds_m_s = speeds_of(ids, self._motion.velocities_of(index, ids))
            view = LabelledView.of(result.frame.calibration, labels.dont_care_px)
            if truth is None and (self._is_labelled_around or view is not None):
                objects = LabelledObjects(labels.boxes_velo, self._motion.of(index, ids), ids)
                truth = truth_of_boxes(
                    result.frame.points_velo,
                    objects,
                    None if self._is_labelled_around else view,
                    self._config.clearance_m,
                )
        if truth is not None:
            for name, counts in count_motion(result, truth, self._config, speeds_m_s).items():
                self._segmented[name] = self._segmented.get(name, MotionCounts()) + counts

    def _add_objects(self, result: Result, labels: Labels) -> FrameObstacles | None:
        """Add the labelled objects of a frame, and return its obstacles where motion and view are known."""
        index, scan = result.frame.index, result.frame.points_velo
        states = result.obstacles.point_states
        unknown = np.full(len(labels), MotionState.UNKNOWN, np.int64)
        motions = unknown if self._motion is None else self._motion.of(index, labels.track_ids)
        objects = LabelledObjects(labels.boxes_velo, motions, labels.track_ids)
        observed = observe_objects(index, scan, states, objects, self._area, self._config)
        self._observed.append(observed)
        view = LabelledView.of(result.frame.calibration, labels.dont_care_px)
        if self._motion is None or view is None:
            return None
        clusters = moving_clusters(index, scan, states, objects, view)
        shadows = self._shadow_detector.update(result, objects, view)
        self._clusters.append(clusters)
        self._shadows.append(shadows)
        is_false = clusters.is_false(_CLUSTER_POINTS[1], ignore_dont_care=True)
        return FrameObstacles(
            observed, self._config, int(shadows.clusters.sum()), int(np.count_nonzero(is_false))
        )

    def compute(self) -> ObstacleReport:
        """Return the metrics of all frames so far."""
        moving, static = self._points.get("moving"), self._points.get("static")
        report = ObstacleReport(
            self._config,
            self._missing(),
            counts={frame: counted.counts for frame, counted in self._counted.items()},
            is_exact=self._is_exact,
            moving_segmentation=self._segmented,
            points_moving=moving,
            points_static=static,
            points_by_length={n: one for n, one in self._by_length.items() if one.true_points},
            free_space=self._free_space,
        )
        if self._observed:
            report = self._add_object_counts(report)
        return self._add_false_obstacles(report) if self._clusters else report

    def _missing(self) -> str | None:
        if not self._observed:
            return "No object metrics: the drive has no labelled boxes."
        if self._motion is None:
            return "No motion of objects: it takes labels with track ids, and INS poses."
        if not self._clusters:
            return "No false moving clusters: it takes images to know the camera's view."
        return None

    def _add_object_counts(self, report: ObstacleReport) -> ObstacleReport:
        """Count objects by number of points, by required share of moving points, and by frames."""
        observed, config = ObjectObservations.concatenate(self._observed), self._config
        by_points = {
            f"{size} points and more": count_objects(observed, replace(config, min_points=size))
            for size in sorted({config.min_points, *_OTHER_MIN_POINTS})
        }
        by_share = {
            f"{100 * share:g} %" if share else "any": count_objects(
                observed, replace(config, moving_share=share)
            )
            for share in sorted({config.moving_share, *_OTHER_MOVING_SHARES})
        }
        warms_up = np.asarray(observed.frames < _WARM_UP)
        return replace(
            report,
            object_motions=object_motions(observed),
            objects=count_objects(observed, config),
            objects_by_min_points=by_points,
            objects_by_moving_share=by_share,
            objects_by_frames={
                f"first {_WARM_UP}": count_objects(observed[warms_up], config),
                "all others": count_objects(observed[~warms_up], config),
            },
            missed_moving=missed_moving(observed, config),
        )

    def _add_false_obstacles(self, report: ObstacleReport) -> ObstacleReport:
        clusters = MovingClusters.concatenate(self._clusters)
        shadows = Shadows.concatenate(self._shadows)
        return replace(
            report,
            false_clusters={
                f"{size} points and more": self._count_clusters(clusters, size)
                for size in _CLUSTER_POINTS
            },
            shadows={
                "shadows": ShadowCounts.of(shadows.clusters),
                "voxels in them": ShadowCounts.of(shadows.voxels),
            },
        )

    def _count_clusters(self, clusters: MovingClusters, min_points: int) -> FalseClusterCounts:
        everywhere = clusters.is_false(min_points, ignore_dont_care=False)
        false = clusters[clusters.is_false(min_points, ignore_dont_care=True)]
        is_static = false.object_motions == MotionState.STATIC
        return FalseClusterCounts(
            clusters=len(false),
            per_frame=len(false) / self._frames,
            on_static_objects=int(np.count_nonzero(is_static)),
            in_warm_up=int(np.count_nonzero(false.frames < _WARM_UP)),
            with_dont_care=int(np.count_nonzero(everywhere)),
        )
