"""False moving clusters: clusters of moving points on the ground plane that no labelled object explains.

Moving points are clustered in cells of the ground plane, closed and connected over eight neighbours. A cluster is
false where `view_share` of its points are in the image, where objects are labelled, and none is within `margin_m` of an
object that moves or whose motion is unknown. Clusters with half of their points in DontCare regions are counted apart.
"""

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np

from perception.evaluation.config import ClusterConfig
from perception.evaluation.objects import FrameAnnotations, LabelledObjects, MotionState
from perception.geometry.boxes import points_inside
from perception.geometry.camera import is_in_view, project
from perception.types import ArrayTable, Bool, Float, Float64, Int, PointState, UInt8

NO_OBJECT = -1


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


def cluster_ids(points_xy: Float, config: ClusterConfig) -> Int:
    """Return (P,) the cluster, 0 to K - 1, of every (P, 2+) point: connected cells with eight neighbours."""
    if len(points_xy) == 0:
        return np.zeros(0, np.int64)
    reach = max(round(config.closing_m / config.cell_m / 2), 0)
    cells = np.floor(points_xy[:, :2] / config.cell_m).astype(np.int64)
    # Room for the closing on every side, so that the border neither joins nor cuts.
    cells += 1 + reach - cells.min(axis=0)
    occupied = np.zeros(cells.max(axis=0) + 2 + reach, np.uint8)
    occupied[cells[:, 0], cells[:, 1]] = 1
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    closed = cv2.morphologyEx(occupied, cv2.MORPH_CLOSE, kernel)
    _, components = cv2.connectedComponents(closed, connectivity=8)
    return np.unique(components[cells[:, 0], cells[:, 1]], return_inverse=True)[1]


def moving_clusters(
    frame: int,
    points_velo: Float,
    states: UInt8,
    annotations: FrameAnnotations,
    config: ClusterConfig | None = None,
) -> MovingClusters:
    """Cluster the moving points of one scan, and look up the labels around each cluster."""
    config = config or ClusterConfig()
    moving = points_velo[states == PointState.MOVING]
    numbers = cluster_ids(moving, config)
    counts = np.bincount(numbers)
    in_view = is_in_view(annotations.view.calibration, moving, annotations.view.image_size_px)
    in_dont_care = _is_in_regions(annotations, moving)
    return MovingClusters(
        frames=np.full(len(counts), frame, np.int64),
        points=counts,
        centers_m=np.stack(
            [np.bincount(numbers, moving[:, axis]) / counts for axis in (0, 1)], axis=-1
        ),
        object_motions=_object_motions(numbers, moving, annotations.objects, config),
        view_shares=np.bincount(numbers, in_view) / counts,
        dont_care_shares=np.bincount(numbers, in_dont_care) / counts,
    )


def is_false(
    clusters: MovingClusters,
    min_points: int,
    config: ClusterConfig | None = None,
    *,
    ignore_dont_care: bool,
) -> Bool:
    """Tell which clusters are false: in view, and on no object that moves or may move.

    Args:
        clusters: Clusters of any number of frames.
        min_points: Number of points of the smallest cluster that counts.
        config: Configuration with which the clusters were made.
        ignore_dont_care: Whether clusters with half of their points in DontCare regions are left out.
    """
    config = config or ClusterConfig()
    unexplained = ~np.isin(clusters.object_motions, (MotionState.MOVING, MotionState.UNKNOWN))
    counts = (clusters.points >= min_points) & (clusters.view_shares >= config.view_share)
    ignored = ignore_dont_care & (clusters.dont_care_shares >= 0.5)
    return np.asarray(unexplained & counts & ~ignored)


def _object_motions(
    numbers: Int, moving: Float, objects: LabelledObjects, config: ClusterConfig
) -> Int:
    object_motions = np.full(len(np.bincount(numbers)), NO_OBJECT, np.int64)
    for motion in (MotionState.STATIC, MotionState.UNKNOWN, MotionState.MOVING):
        boxes = objects.boxes_velo[objects.motions == motion]
        touches = points_inside(boxes, moving, config.margin_m).any(axis=0)
        object_motions[numbers[touches]] = motion
    return object_motions


def _is_in_regions(annotations: FrameAnnotations, points_velo: Float) -> Bool:
    pixels, _ = project(annotations.view.calibration.image_P_velo, points_velo)
    low, high = (
        annotations.view.dont_care_px[:, None, :2],
        annotations.view.dont_care_px[:, None, 2:],
    )
    with np.errstate(invalid="ignore"):
        return np.asarray(((pixels >= low) & (pixels <= high)).all(axis=2).any(axis=0))
