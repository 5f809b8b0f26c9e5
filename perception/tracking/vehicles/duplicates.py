"""Second detections of one object, which neither begin nor continue a track, and second tracks, which become one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from perception.geometry.box_overlap import iou_bev
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px, paired_iou_px
from perception.kernels.graphs import leaders_of
from perception.tracking.vehicles.observations import FrameGeometry, VehicleObservations
from perception.tracking.vehicles.track_update import expected_boxes_px
from perception.tracking.vehicles.vehicle_table import VehicleTable
from perception.types import Bool, Boxes3D, Float64, Int, Vehicles

_MIN_IOU = 0.4  # minimum IoU in the image, unless the returns of both lie apart
_MIN_IOU_APART = 0.5  # minimum IoU in the image where the returns of both lie apart
_MIN_IOU_CAMERAS = 0.1  # minimum IoU from above of two boxes of different cameras; one is tracked
_MIN_SHARE = 0.7  # minimum share of a box without returns that lies within the other
# Minimum IoU of two tracks of one object, from above and in the image: two objects cannot be at one place, but returns of
# a hiding object may put another there.
_MIN_IOU_TRACKS, _MIN_IOU_TRACKS_PX = 0.3, 0.35


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
    order = np.argsort(-quality, kind="stable")
    return leaders_of(np.ascontiguousarray(is_same), order)


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


def merged(
    tracks: VehicleTable, stamp_s: float, cameras: Sequence[FrameGeometry]
) -> tuple[VehicleTable, Int]:
    """Return the tracks of which those at one place are one, and (T,) the row that each has become.

    The state is that of the track that was seen last; id, evidence and detections are those of the older one. Two that are
    seen in one scan stay two.

    Args:
        tracks: T tracks.
        stamp_s: Time of the scan.
        cameras: Pose and projection of the frame in each camera.
    """
    rows = np.arange(len(tracks))
    ones, others = _pairs_at_one_place(tracks, stamp_s, cameras)
    if not len(ones):
        return tracks, rows
    is_same = np.eye(len(tracks), dtype=bool)
    is_same[ones, others] = is_same[others, ones] = True
    # Of two that were seen last together, the one seen more often.
    order = np.lexsort((tracks.detections, tracks.last_seen_s))
    leaders = find_leaders(is_same, np.argsort(order).astype(np.float64))
    older = np.lexsort((tracks.ids, tracks.ids < 0, leaders))
    firsts = older[np.unique(leaders[older], return_index=True)[1]]
    kept = leaders == rows
    merged_ones = replace(
        tracks[kept],
        ids=tracks.ids[firsts],
        detections=tracks.detections[firsts],
        evidence=np.maximum(tracks.evidence[firsts], tracks.evidence[kept]),
    )
    return merged_ones, (np.cumsum(kept) - 1)[leaders]


def _pairs_at_one_place(
    tracks: VehicleTable, stamp_s: float, cameras: Sequence[FrameGeometry]
) -> tuple[Int, Int]:
    """Return the rows of both of each pair of tracks that are one object, of which at most one is seen now."""
    bottom_m = np.column_stack([tracks.mean[:, :2], tracks.low_world_m])
    boxes = Boxes3D(bottom_m, tracks.sizes_m, tracks.yaw_rad)
    is_seen = tracks.last_seen_s >= stamp_s
    is_one = tracks.is_located[:, None] & tracks.is_located & ~(is_seen[:, None] & is_seen)
    is_one &= iou_bev(boxes, boxes) >= _MIN_IOU_TRACKS
    ones, others = np.nonzero(np.triu(is_one, 1))
    if not len(ones):
        return ones, others
    numbers = tracks.cameras[np.append(ones, ones)]
    frame = FrameGeometry.of_rows(cameras, numbers)
    boxes_px = expected_boxes_px(tracks[np.append(ones, others)], frame, numbers)
    is_one = paired_iou_px(*np.split(np.nan_to_num(boxes_px), 2)) >= _MIN_IOU_TRACKS_PX
    return ones[is_one], others[is_one]


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
