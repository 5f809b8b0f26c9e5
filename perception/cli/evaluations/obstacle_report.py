"""`trifuse evaluate obstacles`, below the flags: gather over a drive, make figures, print them."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from data.derived.motion_labels import MotionLabelConfig, MotionLabels, label_drive_motion
from data.kitti.sequence import KittiSequence
from perception.evaluation.false_clusters import (
    ClusterConfig,
    FrameAnnotations,
    MovingClusters,
    is_false,
    moving_clusters,
)
from perception.evaluation.objects import LabelledObjects, MotionState
from perception.evaluation.obstacles import (
    ObjectCounts,
    ObjectMatchConfig,
    ObjectObservations,
    PointMotion,
    count_objects,
    observe_objects,
    point_motion,
)
from perception.evaluation.shadows import ShadowConfig, ShadowDetector, Shadows
from perception.geometry.grids import LocalArea
from perception.types import Drive, Frame, Labels, Result

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
        "at the object rule's min_points or other sizes"
    ),
    "shadows": (
        "static voxels, in view, where a labelled moving object was within memory_s and no labelled "
        "object is now: false static obstacles"
    ),
    "points": (
        "points called moving against points of objects that move, points called static against all "
        "others above the ground; labelled points below the area's height, summed over frames; points "
        "less than the clearance over the ground are called ground by design"
    ),
}


@dataclass(frozen=True)
class ObstacleProtocol:
    """When an object counts, is found, or is false.

    Attributes:
        objects: of labelled objects.
        clusters: of false moving clusters.
        motion: of what moves by the labels.
        shadows: of false static obstacles.
        cluster_points: smaller clusters do not count; the thesis' T_d.
        warm_up: first frames that are counted apart too, since motion needs a history.
        other_min_points: counted beside the object rule's own.
        other_moving_shares: counted beside the object rule's own; 0 asks for any point.
        other_cluster_points: counted beside cluster_points.
    """

    objects: ObjectMatchConfig = field(default_factory=ObjectMatchConfig)
    clusters: ClusterConfig = field(default_factory=ClusterConfig)
    motion: MotionLabelConfig = field(default_factory=MotionLabelConfig)
    shadows: ShadowConfig = field(default_factory=ShadowConfig)
    cluster_points: int = 5
    warm_up: int = 1
    other_min_points: tuple[int, ...] = (1, 5, 50)
    other_moving_shares: tuple[float, ...] = (0.0, 0.1, 0.5)
    other_cluster_points: tuple[int, ...] = (1, 20)


@dataclass(frozen=True)
class FalseClusters:
    """How many moving clusters nothing explains.

    Attributes:
        min_points: smaller ones do not count.
        clusters: in the camera's view and outside DontCare regions.
        on_static_objects: of these on a labelled object that stands.
        in_warm_up: of these in the first frames, in which motion has no history.
        with_dont_care: also those in DontCare regions.
        per_frame: clusters over the frames evaluated.
    """

    min_points: int
    clusters: int
    on_static_objects: int
    in_warm_up: int
    with_dont_care: int
    per_frame: float


@dataclass(frozen=True)
class ObstacleReport:
    """Everything measured of the obstacles of one drive.

    Attributes:
        protocol: how it was measured.
        frames: evaluated.
        observed: labelled objects of all frames, or None without labels.
        clusters: what was found to move, or None where labels or INS do not tell what moves, or no
            camera whose view was labelled.
        shadows: false static obstacles, or None as with the clusters.
        points: counts of points, or None without exact truth.
        has_motion: whether labels and INS tell what moves.
    """

    protocol: ObstacleProtocol
    frames: int
    observed: ObjectObservations | None
    clusters: MovingClusters | None
    shadows: Shadows | None
    points: PointMotion | None
    has_motion: bool

    def counts(self, observed: ObjectObservations | None = None, **changes: Any) -> ObjectCounts:  # noqa: ANN401
        """Count objects under the protocol's rule, or one that is changed in places."""
        rows = self.observed if observed is None else observed
        if rows is None:
            rows = ObjectObservations.concatenate([])
        return count_objects(rows, replace(self.protocol.objects, **changes))

    def counts_by_min_points(self) -> list[ObjectCounts]:
        """Count objects of different least numbers of points."""
        sizes = {self.protocol.objects.min_points, *self.protocol.other_min_points}
        return [self.counts(min_points=size) for size in sorted(sizes)]

    def counts_by_moving_share(self) -> dict[str, ObjectCounts]:
        """Count objects under different shares of points that must move."""
        shares = {self.protocol.objects.moving_share, *self.protocol.other_moving_shares}
        names = {share: f"{100 * share:g} %" if share else "any" for share in sorted(shares)}
        return {name: self.counts(moving_share=share) for share, name in names.items()}

    def counts_by_warm_up(self) -> dict[str, ObjectCounts]:
        """Count the objects of the first frames and those of all others."""
        if self.observed is None:
            return {}
        warms_up = np.asarray(self.observed.frames < self.protocol.warm_up)
        return {
            f"first {self.protocol.warm_up}": self.counts(self.observed[warms_up]),
            "all others": self.counts(self.observed[~warms_up]),
        }

    def false_clusters(self) -> list[FalseClusters]:
        """Count false clusters of different least sizes."""
        if self.clusters is None:
            return []
        sizes = {self.protocol.cluster_points, *self.protocol.other_cluster_points}
        return [self._false_clusters(self.clusters, size) for size in sorted(sizes)]

    def _false_clusters(self, clusters: MovingClusters, size: int) -> FalseClusters:
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


def measure_obstacles(
    drive: Drive, results: Iterable[Result], area: LocalArea, protocol: ObstacleProtocol
) -> ObstacleReport:
    """Compare the obstacles of each result with the labels and the truth of its frame."""
    motion = _motion_of(drive, protocol.motion)
    observed: list[ObjectObservations] = []
    clusters: list[MovingClusters] = []
    shadows: list[Shadows] = []
    shadow_detector = ShadowDetector(protocol.shadows)
    points: list[PointMotion] = []
    frames = 0
    for result in results:
        frames += 1
        scan, states = result.frame.points_velo, result.obstacles.point_states
        index = result.frame.index
        if drive.has_labels:
            labels = drive.labels(index)
            objects = _objects(labels, index, motion)
            observed.append(observe_objects(index, scan, states, objects, area, protocol.objects))
            annotations = _annotations(objects, labels, result.frame) if motion else None
            if annotations is not None:
                clusters.append(
                    moving_clusters(index, scan, states, annotations, protocol.clusters)
                )
                shadows.append(shadow_detector.shadows(result, annotations))
        truth = drive.point_truth(index)
        if truth is not None:
            points.append(point_motion(states, truth.classes, truth.is_moving))
    return ObstacleReport(
        protocol=protocol,
        frames=frames,
        observed=ObjectObservations.concatenate(observed) if observed else None,
        clusters=MovingClusters.concatenate(clusters) if clusters else None,
        shadows=Shadows.concatenate(shadows) if shadows else None,
        points=sum(points, PointMotion()) if points else None,
        has_motion=motion is not None,
    )


def _motion_of(drive: Drive, thresholds: MotionLabelConfig) -> MotionLabels | None:
    if isinstance(drive, KittiSequence) and drive.has_labels and drive.has_poses:
        return label_drive_motion(drive, thresholds)
    return None


def _objects(labels: Labels, index: int, motion: MotionLabels | None) -> LabelledObjects:
    unknown = np.full(len(labels), MotionState.UNKNOWN, np.int64)
    motions = unknown if motion is None else motion.of(index, labels.track_ids)
    return LabelledObjects(labels.boxes_velo, motions, labels.track_ids)


def _annotations(objects: LabelledObjects, labels: Labels, frame: Frame) -> FrameAnnotations | None:
    calibration = frame.calibration
    if calibration is None or calibration.image_size_px is None:
        return None
    return FrameAnnotations(objects, labels.dont_care_px, calibration, calibration.image_size_px)
