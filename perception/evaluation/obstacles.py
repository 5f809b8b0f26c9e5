"""Labelled objects found and missed as obstacles and as moving, and the motion of every point where known.

The protocol, which the thesis leaves to a human observer (Table 7.2):

- An object counts in a frame when the bottom centre of its box is in the local area and the box holds
  at least `min_points` points of the scan between `clearance_m` above its bottom and the area's height.
  The box says where the ground is, so that a wrong ground hides nothing.
- It is found as an obstacle when `found_share` of these points are STATIC or MOVING.
- A moving object is found to move when `moving_share` of those obstacle points are MOVING. An object
  that slides along itself, as a van does, need not change all over, and a quarter is more than the
  stray points at its edges make; other shares are counted beside it.
- A static object with the same share of moving points is a false positive.
- Objects whose motion is unknown count as obstacles only.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.confusion import Confusion, confusion
from perception.evaluation.ground import GROUND_CLASSES, UNLABELLED_CLASSES
from perception.evaluation.objects import LabelledObjects, MotionState, length_classes
from perception.evaluation.obstacle_counts import ObstacleCounts
from perception.evaluation.report import Metric, Metrics
from perception.geometry.boxes import points_inside
from perception.geometry.grids import LocalArea
from perception.types import (
    ArrayTable,
    Bool,
    Boxes3D,
    Float,
    Int,
    PointState,
    PointTruth,
    UInt8,
)


@dataclass(frozen=True)
class ObjectObservations(ArrayTable):
    """K objects in the area, each in one frame.

    Attributes:
        frames: (K,) Number of the frame.
        track_ids: (K,) Track id, -1 where the labels have no tracks.
        motions: (K,) `MotionState` by the labels.
        boxes_velo: (K) 3D boxes in the LiDAR frame.
        points: (K,) Number of scan points in the box above the clearance.
        obstacle_points: (K,) Number of these points classified as STATIC or MOVING.
        moving_points: (K,) Number of these points classified as MOVING.
    """

    frames: Int
    track_ids: Int
    motions: Int
    boxes_velo: Boxes3D
    points: Int
    obstacle_points: Int
    moving_points: Int

    def is_obstacle(self, share: float) -> Bool:
        """Tell which objects are found as obstacles at a share of their points."""
        return np.asarray((self.points > 0) & (self.obstacle_points >= share * self.points))

    def is_moving(self, share: float) -> Bool:
        """Tell which objects are found to move at a share of their obstacle points; 0 asks for any point."""
        enough = self.moving_points >= share * self.obstacle_points
        return np.asarray((self.moving_points > 0) & enough)


def observe_objects(
    frame: int,
    points_velo: Float,
    states: UInt8,
    objects: LabelledObjects,
    area: LocalArea,
    config: ObjectMatchConfig,
) -> ObjectObservations:
    """Count the points of every labelled object in the area by their predicted state."""
    bottom_m = objects.boxes_velo.bottom_m
    present = area.contains_xy(bottom_m)
    boxes, bottom_m = objects.boxes_velo[present], bottom_m[present]
    rise_m = points_velo[None, :, 2] - bottom_m[:, 2, None]
    in_area = area.contains_xy(points_velo)
    holds = points_inside(boxes, points_velo) & in_area
    holds &= (rise_m >= config.clearance_m) & (rise_m < area.height_m)
    is_obstacle = np.isin(states, (PointState.STATIC, PointState.MOVING))
    return ObjectObservations(
        frames=np.full(len(boxes), frame, np.int64),
        track_ids=objects.track_ids[present],
        motions=objects.motions[present],
        boxes_velo=boxes,
        points=np.count_nonzero(holds, axis=1),
        obstacle_points=np.count_nonzero(holds & is_obstacle, axis=1),
        moving_points=np.count_nonzero(holds & (states == PointState.MOVING), axis=1),
    )


@dataclass(frozen=True)
class ObjectCounts(Metrics):
    """Numbers of labelled objects found, missed and misclassified; each object counts once per frame.

    Attributes:
        min_points: Number of points that an object must hold to count.
        objects: Number of objects of any motion.
        missed_objects: Number of objects not found as obstacles.
        missed_share: Share of the objects not found as obstacles; NaN without objects.
        moving: Number of moving objects.
        missed_moving: Number of moving objects not found to move.
        moving_tracks: Number of different tracks of the moving objects.
        tracks_never_moving: Number of these tracks found to move in no frame.
        static: Number of static objects.
        false_moving: Number of static objects found to move.
    """

    min_points: int
    objects: Annotated[int, Metric("objects")]
    missed_objects: Annotated[int, Metric("missed")]
    missed_share: Annotated[float, Metric("missed [%]", ".1%")]
    moving: Annotated[int, Metric("moving")]
    missed_moving: Annotated[int, Metric("found static")]
    moving_tracks: Annotated[int, Metric("tracks")]
    tracks_never_moving: Annotated[int, Metric("never moving")]
    static: Annotated[int, Metric("static")]
    false_moving: Annotated[int, Metric("found moving")]


def count_objects(observed: ObjectObservations, config: ObjectMatchConfig) -> ObjectCounts:
    """Apply the protocol of this file to the objects of any number of frames."""
    counted = observed[observed.points >= config.min_points]
    moves, is_static = counted.motions == MotionState.MOVING, counted.motions == MotionState.STATIC
    is_missed = ~counted.is_obstacle(config.found_share)
    found_moving = counted.is_moving(config.moving_share)
    tracks = np.unique(counted.track_ids[moves])
    found_tracks = np.unique(counted.track_ids[moves & found_moving])
    return ObjectCounts(
        min_points=config.min_points,
        objects=len(counted),
        missed_objects=int(np.count_nonzero(is_missed)),
        missed_share=float(is_missed.mean()) if len(counted) else float("nan"),
        moving=int(np.count_nonzero(moves)),
        missed_moving=int(np.count_nonzero(moves & ~found_moving)),
        moving_tracks=len(tracks),
        tracks_never_moving=len(tracks) - len(found_tracks),
        static=int(np.count_nonzero(is_static)),
        false_moving=int(np.count_nonzero(is_static & found_moving)),
    )


def missed_moving(observed: ObjectObservations, config: ObjectMatchConfig) -> ObjectObservations:
    """Return the moving objects that were not found to move."""
    counts = (observed.points >= config.min_points) & (observed.motions == MotionState.MOVING)
    return observed[counts & ~observed.is_moving(config.moving_share)]


@dataclass(frozen=True)
class FrameObstacles:
    """Obstacles of one frame, found and missed, and the numbers of false ones.

    Attributes:
        observed: Obstacles of any number of points.
        config: Thresholds at which an obstacle counts and is found.
        false_obstacles: Number of detected obstacles where there is none.
        false_moving: Number of detected moving obstacles where nothing moves.
    """

    observed: ObjectObservations
    config: ObjectMatchConfig
    false_obstacles: int
    false_moving: int

    @property
    def counted(self) -> ObjectObservations:
        """Obstacles of enough points to count."""
        return self.observed[self.observed.points >= self.config.min_points]

    @property
    def is_missed(self) -> Bool:
        """(K,) whether each counted obstacle is not found."""
        return np.asarray(~self.counted.is_obstacle(self.config.found_share))

    @property
    def counts(self) -> ObstacleCounts:
        """Counts of the frame."""
        objects = count_objects(self.observed, self.config)
        return ObstacleCounts(
            obstacles=objects.objects,
            moving=objects.moving,
            missed_obstacles=objects.missed_objects,
            missed_moving=objects.missed_moving,
            false_obstacles=self.false_obstacles,
            false_moving=self.false_moving,
        )


def object_motions(observed: ObjectObservations) -> dict[str, str]:
    """Return the motion of each track in the area by its id: moving where it moves in any frame, else static."""
    motion_of: dict[str, str] = {}
    for state in (MotionState.UNKNOWN, MotionState.STATIC, MotionState.MOVING):
        ids = np.unique(observed.track_ids[observed.motions == state]).tolist()
        motion_of |= {str(number): state.name.lower() for number in ids if number >= 0}
    return dict(sorted(motion_of.items(), key=lambda item: int(item[0])))


def motion_confusions(states: UInt8, classes: Int, is_moving: Bool) -> dict[str, Confusion]:
    """Compare (N,) states with the exact classes and motions of a synthetic scan.

    Points classified as MOVING are compared with the points of objects that move at this moment, those classified
    as STATIC with all other points above the true ground. Points without a class do not count, nor do those above
    the area, which ends at a height. A point less than the clearance over the ground is classified as ground by
    design; where it belongs to an object (feet, tyres) it costs recall.
    """
    counts = (states != PointState.OUTSIDE) & ~np.isin(classes, UNLABELLED_CLASSES)
    states, classes, moves = states[counts], classes[counts], is_moving[counts]
    is_static = ~moves & ~np.isin(classes, GROUND_CLASSES)
    return {
        "moving": confusion(states == PointState.MOVING, moves),
        "static": confusion(states == PointState.STATIC, is_static),
    }


def motion_by_length(
    states: UInt8, truth: PointTruth, boxes: Boxes3D, track_ids: Int
) -> dict[str, Confusion]:
    """Compare the moving points of labelled objects with exact truth, by the length of the object.

    Long bodies creep: most of their surface fills the place that it filled before.

    Args:
        states: (N,) `PointState` of the scan's points.
        truth: Exact truth of the same points.
        boxes: M boxes of the objects.
        track_ids: (M,) Track ids of the objects, which are those of the truth.
    """
    is_obstacle = np.isin(states, (PointState.STATIC, PointState.MOVING))
    by_length = {}
    for name, is_of_class in length_classes(boxes.size_m[:, 0]).items():
        counts = is_obstacle & np.isin(truth.instances, track_ids[is_of_class] + 1)
        counts &= truth.instances > 0
        moving = states[counts] == PointState.MOVING
        by_length[name] = confusion(moving, truth.is_moving[counts])
    return by_length
