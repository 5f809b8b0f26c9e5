"""What was found to move, as clusters on the ground plane, and which of them nothing explains."""

from dataclasses import dataclass

import cv2
import numpy as np

from perception.evaluation.objects import LabelledObjects, MotionState
from perception.evaluation.rows import Rows
from perception.geometry.boxes import points_inside
from perception.geometry.camera import is_in_view, project
from perception.types import Bool, Calibration, Float, Float64, Int, PointState, UInt8

NO_OBJECT = -1


@dataclass(frozen=True)
class ClusterConfig:
    """How moving points become clusters, and what excuses one.

    Attributes:
        cell_m: edge of a cell of the ground plane.
        closing_m: gaps up to about this width between cells do not part a cluster.
        margin_m: a labelled object explains what lies within its box grown by so much on every side.
        view_share: of a cluster's points that must be in the image, since nothing else is labelled.
    """

    cell_m: float = 0.2
    closing_m: float = 0.5
    margin_m: float = 0.5
    view_share: float = 0.5


@dataclass(frozen=True)
class FrameAnnotations:
    """What was labelled around the K clusters of a frame.

    Attributes:
        objects: all that are labelled, in the area or not.
        dont_care_px: (D, 4) image regions in which nothing was labelled.
        calibration: of the camera whose view was labelled.
        image_size_px: (width, height).
    """

    objects: LabelledObjects
    dont_care_px: Float64
    calibration: Calibration
    image_size_px: tuple[int, int]


@dataclass(frozen=True)
class MovingClusters(Rows):
    """K clusters of points that were found to move, of one frame or of many.

    Attributes:
        frames: (K,) number of the frame.
        points: (K,) how many points.
        centers_m: (K, 2) their mean x and y in the LiDAR frame.
        object_motions: (K,) `Motion` of the object whose grown box holds one of the points; NO_OBJECT where
            none does. Of several the moving one counts, then the unknown, then the static.
        view_shares: (K,) of the points that fall in the image.
        dont_care_shares: (K,) of the points that fall in a DontCare region.
    """

    frames: Int
    points: Int
    centers_m: Float64
    object_motions: Int
    view_shares: Float64
    dont_care_shares: Float64


def cluster_ids(points_xy: Float, config: ClusterConfig) -> Int:
    """Return (P,) the cluster, 0 to K - 1, of every (P, 2+) point: cells joined over eight neighbours."""
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
    """Cluster the points of one scan that were found to move, and note what lies around each."""
    config = config or ClusterConfig()
    moving = points_velo[states == PointState.MOVING]
    numbers = cluster_ids(moving, config)
    counts = np.bincount(numbers)
    in_view = is_in_view(annotations.calibration, moving, annotations.image_size_px)
    uncared = _is_in_regions(annotations, moving)
    return MovingClusters(
        frames=np.full(len(counts), frame, np.int64),
        points=counts,
        centers_m=np.stack(
            [np.bincount(numbers, moving[:, axis]) / counts for axis in (0, 1)], axis=-1
        ),
        object_motions=_object_motions(numbers, moving, annotations.objects, config),
        view_shares=np.bincount(numbers, in_view) / counts,
        dont_care_shares=np.bincount(numbers, uncared) / counts,
    )


def is_false(
    clusters: MovingClusters,
    min_points: int,
    config: ClusterConfig | None = None,
    *,
    ignore_dont_care: bool,
) -> Bool:
    """Tell which clusters nothing explains: in view, and on no object that moves or may move.

    Args:
        clusters: of any number of frames.
        min_points: smaller clusters do not count.
        config: as the clusters were made.
        ignore_dont_care: leave out clusters with half of their points in DontCare regions.
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
    pixels, _ = project(annotations.calibration.image_P_velo, points_velo)
    low, high = annotations.dont_care_px[:, None, :2], annotations.dont_care_px[:, None, 2:]
    with np.errstate(invalid="ignore"):
        return np.asarray(((pixels >= low) & (pixels <= high)).all(axis=2).any(axis=0))
