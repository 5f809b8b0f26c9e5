"""Errors that labels can prove in the camera's view: false moving clusters, and shadows of moving objects.

Moving points are clustered in cells of the ground plane, closed and connected over eight neighbours. A cluster is
false where half of its points are in the image, where objects are labelled, and none is within 0.5 m of an object
that moves or whose motion is unknown. Clusters with half of their points in DontCare regions are counted apart.

A place that a moving object occupied in the last 2 s cannot hold a static obstacle. Static voxels in it are the
object's shadow (Table 7.2): the thesis' main kind of false obstacle with slow objects, and the only kind of false
static obstacle that KITTI's labels can prove.
"""

from collections import deque
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np

from perception.evaluation.objects import LabelledObjects, LabelledView, MotionState, raised_boxes
from perception.geometry.boxes import points_inside, transform_boxes
from perception.geometry.se3 import inverse
from perception.types import (
    ArrayTable,
    Bool,
    Boxes3D,
    Float,
    Float64,
    Int,
    PointState,
    Result,
    UInt8,
)

NO_OBJECT = -1
MEMORY_S = 2.0
_CELL_M = 0.2  # edge of a cell of the ground plane
_CLOSING_M = 0.5  # width of the gaps between cells that do not separate clusters
_MARGIN_M = 0.5  # by which labelled boxes are grown: what lies inside belongs to the object
_SHRINK_M = 0.1  # by which past boxes are shrunk on every side, since labels are loose
_CLEARANCE_M = 0.3  # over the bottom of a past box, below which voxels may be ground
_MIN_VOXELS = 5  # of a cluster of shadow voxels
_MIN_SHARE = 0.5  # of a cluster's points in the image, and in DontCare regions


@dataclass(frozen=True)
class MovingClusters(ArrayTable):
    """K clusters of points classified as moving, of one frame or of many.

    Attributes:
        frames: (K,) Number of the frame.
        points: (K,) Number of points.
        centers_m: (K, 2) Mean x and y of the points in the LiDAR frame.
        object_motions: (K,) `MotionState` of the object whose grown box holds one of the points; NO_OBJECT
            where none does. Of several objects the moving one counts, then the unknown, then the static.
        view_shares: (K,) Share of the points that fall in the image.
        dont_care_shares: (K,) Share of the points that fall in a DontCare region.
    """

    frames: Int
    points: Int
    centers_m: Annotated[Float64, 2]
    object_motions: Int
    view_shares: Float64
    dont_care_shares: Float64

    def is_false(self, min_points: int, *, ignore_dont_care: bool) -> Bool:
        """Tell which clusters are false: in view, and on no object that moves or may move.

        Args:
            min_points: Number of points of the smallest cluster that counts.
            ignore_dont_care: Whether clusters with half of their points in DontCare regions are left out.
        """
        unexplained = ~np.isin(self.object_motions, (MotionState.MOVING, MotionState.UNKNOWN))
        counts = (self.points >= min_points) & (self.view_shares >= _MIN_SHARE)
        return unexplained & counts & ~(ignore_dont_care & (self.dont_care_shares >= _MIN_SHARE))


def cluster_ids(points_xy: Float, closing_m: float = _CLOSING_M) -> Int:
    """Return (P,) the cluster, 0 to K - 1, of every (P, 2+) point: connected cells with eight neighbours."""
    if len(points_xy) == 0:
        return np.zeros(0, np.int64)
    reach = round(closing_m / _CELL_M / 2)
    cells = np.floor(points_xy[:, :2] / _CELL_M).astype(np.int64)
    # Room for the closing on every side, so that the border neither joins nor cuts.
    cells += 1 + reach - cells.min(axis=0)
    occupied = np.zeros(cells.max(axis=0) + 2 + reach, np.uint8)
    occupied[cells[:, 0], cells[:, 1]] = 1
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    closed = cv2.morphologyEx(occupied, cv2.MORPH_CLOSE, kernel)
    _, components = cv2.connectedComponents(closed, connectivity=8)
    return np.unique(components[cells[:, 0], cells[:, 1]], return_inverse=True)[1]


def moving_clusters(
    frame: int, points_velo: Float, states: UInt8, objects: LabelledObjects, view: LabelledView
) -> MovingClusters:
    """Cluster the moving points of one scan, and look up the labels around each cluster."""
    moving = points_velo[states == PointState.MOVING]
    numbers = cluster_ids(moving)
    counts = np.bincount(numbers)
    sums_m = [np.bincount(numbers, moving[:, axis]) for axis in (0, 1)]
    motions = np.full(len(counts), NO_OBJECT, np.int64)
    for motion in (MotionState.STATIC, MotionState.UNKNOWN, MotionState.MOVING):
        boxes = objects.boxes_velo[objects.motions == motion]
        motions[numbers[points_inside(boxes, moving, _MARGIN_M).any(axis=0)]] = motion
    return MovingClusters(
        frames=np.full(len(counts), frame, np.int64),
        points=counts,
        centers_m=np.stack(sums_m, axis=-1) / counts[:, None],
        object_motions=motions,
        view_shares=np.bincount(numbers, view.contains(moving)) / counts,
        dont_care_shares=np.bincount(numbers, view.is_dont_care(moving)) / counts,
    )


@dataclass(frozen=True)
class Shadows(ArrayTable):
    """Shadows in F frames.

    Attributes:
        frames: (F,) Number of the frame.
        voxels: (F,) Number of static voxels in places that moving objects have left.
        clusters: (F,) Number of clusters of these voxels.
    """

    frames: Int
    voxels: Int
    clusters: Int


class ShadowDetector:
    """Remembers for a while where labelled objects have moved, in the world frame."""

    def __init__(self, memory_s: float = MEMORY_S) -> None:
        self._memory_s = memory_s
        self._past: deque[tuple[float, Boxes3D]] = deque()

    def update(self, result: Result, objects: LabelledObjects, view: LabelledView) -> Shadows:
        """Find the shadows among the static voxels of one frame, then remember its moving objects."""
        static_velo, stamp_s = result.obstacles.static.centers_m, result.frame.stamp_s
        world_SE3_velo = result.odom_SE3_velo
        while self._past and self._past[0][0] < stamp_s - self._memory_s:
            self._past.popleft()
        lies_in_shadow = np.zeros(len(static_velo), bool)
        for _, boxes_world in self._past:
            left = raised_boxes(transform_boxes(inverse(world_SE3_velo), boxes_world), _CLEARANCE_M)
            lies_in_shadow |= points_inside(left, static_velo, -_SHRINK_M).any(axis=0)
        present = objects.boxes_velo
        lies_in_shadow &= ~points_inside(present, static_velo, _MARGIN_M).any(axis=0)
        lies_in_shadow &= view.contains(static_velo)
        moving = present[objects.motions == MotionState.MOVING]
        self._past.append((stamp_s, transform_boxes(world_SE3_velo, moving)))
        sizes = np.bincount(cluster_ids(static_velo[lies_in_shadow]))
        return Shadows(
            frames=np.array([result.frame.index]),
            voxels=np.array([np.count_nonzero(lies_in_shadow)]),
            clusters=np.array([np.count_nonzero(sizes >= _MIN_VOXELS)]),
        )
