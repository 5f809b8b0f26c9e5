"""Obstacles of a synthetic scan by the exact class of every point: every distinct element above the ground (7.1.1).

- An element is an object with a number (a vehicle or a person), or a connected cluster of points of one kind: posts
  with their signs, trees and hedges, walls, fences, and other structures.
- A point counts in the local area, in the camera's view where there is one, and from `clearance_m` above the true
  ground, which is the nearest point of a ground class, to as much below the area's height: what an estimated ground
  a few centimetres off leaves out is no miss.
- Elements are found, and found to move, at the thresholds of labelled objects.
- A cluster of points classified as obstacles is false where at least half of them are ground; a cluster of points
  classified as moving is false where at least half of them do not move.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.spatial import cKDTree

from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.false_obstacles import cluster_ids
from perception.evaluation.ground import GROUND_CLASSES, UNLABELLED_CLASSES
from perception.evaluation.objects import LabelledView, MotionState
from perception.evaluation.obstacles import FrameObstacles, ObjectObservations
from perception.geometry.grids import LocalArea
from perception.types import (
    ArrayTable,
    Bool,
    Boxes3D,
    Float,
    Float64,
    Int,
    PointState,
    PointTruth,
    Result,
    UInt8,
)

# SemanticKITTI's classes of one element: a sign stands on its post (80), leaves hang on their trunk (71).
_KIND_OF = {81: 80, 70: 71}
_MIN_POINTS = 5  # of a false cluster; the thesis' T_d
_MIN_SHARE = 0.5
_OBSTACLE = (PointState.STATIC, PointState.MOVING)


@dataclass(frozen=True)
class ExactPoints(ArrayTable):
    """N points of a scan that count, with their exact truth and their predicted state.

    Attributes:
        points_m: (N, 4) Points in the LiDAR frame, with their reflectance.
        states: (N,) Predicted `PointState`.
        classes: (N,) SemanticKITTI class.
        instances: (N,) Number of the object, 0 without one.
        is_moving: (N,) Whether the object of the point moves.
        heights_m: (N,) Height above the true ground.
    """

    points_m: Annotated[Float, 4]
    states: UInt8
    classes: Int
    instances: Int
    is_moving: Bool
    heights_m: Float64

    @property
    def is_ground(self) -> Bool:
        """(N,) whether the point lies on the true ground."""
        return np.isin(self.classes, GROUND_CLASSES)


def count_exactly(
    result: Result, truth: PointTruth, area: LocalArea, config: ObjectMatchConfig
) -> FrameObstacles:
    """Return the elements of one frame, and the numbers of false clusters."""
    points = exact_points(result, truth, area)
    obstacles = points[np.isin(points.states, _OBSTACLE)]
    moving = points[points.states == PointState.MOVING]
    return FrameObstacles(
        observe_elements(result.frame.index, points, area, config),
        config,
        false_obstacles=count_false(obstacles.points_m, ~obstacles.is_ground),
        false_moving=count_false(moving.points_m, moving.is_moving),
    )


def exact_points(result: Result, truth: PointTruth, area: LocalArea) -> ExactPoints:
    """Return the points of a frame that count: labelled, in the local area, and in the camera's view."""
    points = result.frame.points_velo
    counts = area.contains_xy(points) & ~np.isin(truth.classes, UNLABELLED_CLASSES)
    heights_m = _heights_m(points[counts], np.isin(truth.classes[counts], GROUND_CLASSES))
    view = LabelledView.of(result.frame.calibration, np.zeros((0, 4)))
    counted = ExactPoints(
        points[counts],
        result.obstacles.point_states[counts],
        truth.classes[counts],
        truth.instances[counts],
        truth.is_moving[counts],
        heights_m,
    )
    return counted if view is None else counted[view.contains(counted.points_m)]


def _heights_m(points: Float, is_ground: Bool) -> Float64:
    """Return (N,) heights above the nearest ground point over the plane; none is known without ground."""
    ground = points[is_ground]
    if not len(ground):
        return np.full(len(points), np.nan)
    _, nearest = cKDTree(ground[:, :2]).query(points[:, :2])
    return np.asarray(points[:, 2] - ground[nearest, 2], np.float64)


def observe_elements(
    frame: int, points: ExactPoints, area: LocalArea, config: ObjectMatchConfig
) -> ObjectObservations:
    """Count the points of every element in the area by their predicted state."""
    above_m, below_m = config.clearance_m, area.height_m - config.clearance_m
    rises = (points.heights_m >= above_m) & (points.heights_m < below_m)
    points = points[rises & ~points.is_ground]
    ids = element_ids(points)
    boxes = [
        _box_around(points.points_m[ids == number]) for number in range(ids.max(initial=-1) + 1)
    ]
    boxes_velo = Boxes3D.concatenate(boxes)
    first = np.unique(ids, return_index=True)[1]
    counts = np.bincount(ids)
    is_moving = np.bincount(ids, points.is_moving) >= _MIN_SHARE * counts
    is_obstacle = np.isin(points.states, _OBSTACLE)
    return ObjectObservations(
        frames=np.full(len(counts), frame, np.int64),
        track_ids=np.asarray(points.instances[first] - 1, np.int64),
        motions=np.where(is_moving, MotionState.MOVING, MotionState.STATIC),
        boxes_velo=boxes_velo,
        points=counts,
        obstacle_points=np.bincount(ids[is_obstacle], minlength=len(counts)),
        moving_points=np.bincount(ids[points.states == PointState.MOVING], minlength=len(counts)),
    )


def element_ids(points: ExactPoints) -> Int:
    """Return (N,) the element of every point, numbered from 0: its object, or its cluster of one kind."""
    kinds = np.array([_KIND_OF.get(kind, kind) for kind in points.classes.tolist()], np.int64)
    # Objects have their own number as their kind, below all classes.
    kinds = np.where(points.instances > 0, -points.instances, kinds)
    ids, count = np.zeros(len(points), np.int64), 0
    for kind in np.unique(kinds):
        rows = np.flatnonzero(kinds == kind)
        ids[rows] = count + (cluster_ids(points.points_m[rows]) if kind > 0 else 0)
        count = int(ids[rows].max()) + 1
    return ids


def _box_around(points_m: Float) -> Boxes3D:
    """Return the box along the axes of the LiDAR that encloses points."""
    low, high = points_m[:, :3].min(axis=0), points_m[:, :3].max(axis=0)
    bottom = np.array([[*(low[:2] + high[:2]) / 2, low[2]]], np.float64)
    return Boxes3D(bottom, (high - low)[None].astype(np.float64), np.zeros(1))


def count_false(points_m: Float, is_true: Bool, min_points: int = _MIN_POINTS) -> int:
    """Count the clusters of points of which at least half are wrongly classified."""
    return len(false_clusters_m(points_m, is_true, min_points))


def false_clusters_m(points_m: Float, is_true: Bool, min_points: int = _MIN_POINTS) -> Float64:
    """Return (K, 2) centers of the clusters of points of which at least half are wrongly classified.

    Args:
        points_m: (N, 2+) points of one class.
        is_true: (N,) whether the class is right.
        min_points: Number of points of the smallest cluster that counts.
    """
    ids = cluster_ids(points_m)
    sizes = np.bincount(ids)
    is_false = (np.bincount(ids, is_true) <= _MIN_SHARE * sizes) & (sizes >= min_points)
    sums = [np.bincount(ids, points_m[:, axis])[is_false] for axis in (0, 1)]
    return np.stack(sums, axis=1) / sizes[is_false, None]
