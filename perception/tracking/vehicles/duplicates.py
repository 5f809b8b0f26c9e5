"""Second detections of one object, which neither begin nor continue a track, and are not shown beside it."""

import numpy as np

from perception.geometry.box_overlap import iou_bev
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px
from perception.tracking.vehicles.observations import VehicleObservations
from perception.types import Bool, Float64, Int, Vehicles

_MIN_IOU = 0.4  # minimum IoU in the image, unless the returns of both lie apart
_MIN_IOU_APART = 0.75  # minimum IoU in the image where the returns of both lie apart
_MIN_IOU_CAMERAS = 0.1  # minimum IoU from above of two boxes of different cameras; one is tracked
_MIN_SHARE = 0.7  # minimum share of a box without returns that lies within the other


def is_duplicate(observations: VehicleObservations) -> Bool:
    """Return (D,) whether each detection is a second one of an object that a better one has found."""
    covers = covered(observations, observations)
    # Detections of two cameras have been joined on the ground.
    covers &= observations.cameras[:, None] == observations.cameras
    scores = observations.detections.scores
    return np.asarray(find_leaders(covers, scores) != np.arange(len(scores)))


def find_leaders(is_same: Bool, quality: Float64) -> Int:
    """Return (N,) the best row of the object of each: itself where no better one leads, and one that is led leads none.

    Args:
        is_same: (N, N) whether a row shows the object of another one.
        quality: (N,) quality of each; of equal ones the first is better.
    """
    leader_of = np.arange(len(quality))
    is_leader = np.zeros(len(quality), bool)
    order = np.argsort(-quality, kind="stable")
    for row in order.tolist():
        better = order[(is_same[row] & is_leader)[order]]
        leader_of[row] = better[0] if len(better) else row
        is_leader[row] = not len(better)
    return leader_of


def covered(observations: VehicleObservations, others: VehicleObservations) -> Bool:
    """Return (D, O) whether each detection shows the object of another one.

    Cars in a row overlap in the image as much as two boxes of one car do: returns tell them apart.
    """
    found_px, others_px = observations.detections.boxes_px, others.detections.boxes_px
    overlap = iou_px(found_px, others_px)
    is_within = intersection_over_area_px(found_px, others_px) >= _MIN_SHARE
    # Returns decide between boxes that overlap in the image; most rows have no such partner but themselves.
    is_near = overlap >= _MIN_IOU
    found = observations.is_located & (is_near.sum(axis=1) > 1)
    other = others.is_located & (is_near.sum(axis=0) > 1)
    is_apart = np.zeros(overlap.shape, bool)
    is_apart[np.ix_(found, other)] = (
        iou_bev(observations.boxes_world[found], others.boxes_world[other]) <= 0
    )
    return np.asarray(
        (overlap >= np.where(is_apart, _MIN_IOU_APART, _MIN_IOU))
        | (is_within & ~observations.is_located[:, None])
    )


def distinct_rows(vehicles: Vehicles, min_score: float) -> Int:
    """Return the rows of the vehicles from a score on, each object once, in rising order.

    A detector may call one object a truck and a van, and two cameras may show a part of it each: the row of its track is
    it, or else the one of the higher score. Two tracks stay two objects.

    Args:
        vehicles: Tracked vehicles of one frame.
        min_score: Minimum score of a row.
    """
    scores, is_tracked = vehicles.fused.detections.scores, vehicles.ids >= 0
    rows = np.flatnonzero(scores >= min_score)
    rows = rows[np.lexsort((-scores[rows], ~is_tracked[rows]))]
    if is_tracked[rows].all():
        return np.sort(rows)
    boxes, boxes_px = vehicles.boxes[rows], vehicles.fused.detections.boxes_px[rows]
    is_located = np.isfinite(boxes.yaw_rad)
    overlap = np.full((len(rows), len(rows)), np.nan)
    overlap[np.ix_(is_located, is_located)] = iou_bev(boxes[is_located], boxes[is_located])
    is_alike_px = (iou_px(boxes_px, boxes_px) >= _MIN_IOU) & ~(overlap <= 0)
    one_camera = vehicles.cameras[rows, None] == vehicles.cameras[rows]
    is_same = np.where(one_camera, is_alike_px, overlap >= _MIN_IOU_CAMERAS)
    is_same &= ~is_tracked[rows, None]
    best_first = -np.arange(len(rows), dtype=np.float64)
    return np.sort(rows[find_leaders(is_same, best_first) == np.arange(len(rows))])
