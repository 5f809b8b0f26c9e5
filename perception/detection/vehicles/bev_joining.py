"""Joining of the objects of the bird's-eye view with those that cameras and maps have found: each is one vehicle.

A detection in an image and an object seen from above are the same where the outline of its 3D box in that image overlaps
the detection, and both are as far along the ray. The image keeps the rectangle, the tracker decides the class by both names,
the 3D box is the one of the lower stated deviations, and log-odds of scores are added. What a camera should have seen and
has not keeps a lower score.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from perception.detection.fusion.source_record import unseen_odds
from perception.detection.vehicles.bev_objects import LEAST
from perception.geometry.box_overlap import iou_bev
from perception.geometry.box_overlap_px import iou_px
from perception.geometry.camera import box_outlines_px
from perception.geometry.se3 import wrap
from perception.maps.projection import camera_of
from perception.tracking.association import assign_sure_first
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.duplicates import find_leaders
from perception.tracking.vehicles.evidence import log_odds, probability
from perception.tracking.vehicles.observations import (
    ASSUMED_HEIGHT_M,
    SAME_PLACE_IOU,
    FrameGeometry,
)
from perception.types import Bool, Float64, Frame, Int, Vehicles

_MIN_IOU_PX = 0.3  # minimum IoU of a detection and the outline of a 3D box in its image
_MIN_IOU = 0.2  # minimum IoU on the ground, with which that in the image does not matter
_MAX_COST = 3.0  # of a pair that does not overlap, neither of which exists
_MAX_DEVIATIONS = 3.0  # of the distances along the ray of one object
_RAY_NOISE_M, _RAY_NOISE_SHARE = 0.7, 0.04  # deviation of these, and its growth with distance
_ASSUMED_DEPTH_SHARE = 0.3  # deviation of a distance by the height in the image alone
_SURE = 0.5  # minimum existence of a detection that is paired before the others
# What the view from above adds to the log-odds of a detection's score, that its rectangle fits, and of its existence: share
# of its own log-odds, and what being found at all says. Fitted to 140 frames of synthetic streets, of 64 and 32 beams: it
# tells hardly more of the rectangle than the camera does (all of its log-odds would cost precision), of existence as much.
_SCORE_EVIDENCE, _EXISTENCE_EVIDENCE = (0.1, 0.0), (0.5, 1.0)
# Ratio of the deviations from above to those of the camera and its returns at which both boxes are as good, on KITTI's frames.
_INFLATION = 1.4
# Classes that detectors in images do not know; on synthetic drives these miss true ones as often as false ones.
_UNKNOWN_IN_IMAGES = ("Motorcycle", "Bicycle")


def join_bev(
    vehicles: Vehicles, found: Vehicles, frame: Frame, searched: Mapping[int, float]
) -> Vehicles:
    """Return the vehicles of cameras and maps and those of the bird's-eye view, each once, best first.

    Args:
        vehicles: V vehicles by cameras and maps.
        found: M vehicles of the bird's-eye view.
        frame: Frame of both.
        searched: Probability that the detector works in each image that was searched, by the number of its camera.
    """
    rows, of_bev = find_pairs(vehicles, found, frame)
    seen = found.select(of_bev)
    is_better = _INFLATION**2 * spreads_m2(seen) < spreads_m2(vehicles)[rows]
    works = np.array([searched.get(camera, 0.0) for camera in range(len(frame.views))])
    joined = _joined(vehicles, seen, rows, is_better)
    joined = _raised(joined, rows, seen, unseen_odds(works[vehicles.cameras[rows]]))
    left = np.setdiff1d(np.arange(len(found)), of_bev)
    left = left[~are_covered(found, joined)[left]]
    rest = found.select(left)
    is_expected = (rest.cameras >= 0) & ~np.isin(rest.bev_types, _UNKNOWN_IN_IMAGES)
    unseen = unseen_odds(np.where(is_expected, works[rest.cameras], 0.0))
    rest = _with_evidence(rest, unseen, unseen)
    # Returns of an object go with its 3D box.
    row_of = np.full(len(found), -1)
    row_of[of_bev], row_of[left] = rows, len(joined) + np.arange(len(left))
    owners = np.where(np.isin(vehicles.owners, rows[is_better]), -1, vehicles.owners)
    free = np.flatnonzero((owners < 0) & (found.owners >= 0))
    owners[free] = row_of[found.owners[free]]
    both = Vehicles.concatenate([joined, rest], owners)
    return both.select(np.argsort(-both.fused.detections.scores, kind="stable"))


def find_pairs(vehicles: Vehicles, found: Vehicles, frame: Frame) -> tuple[Int, Int]:
    """Return (P,) rows of V vehicles and of M of the bird's-eye view that are one, those that surely exist paired first."""
    overlap_px, focals_px = np.zeros((len(vehicles), len(found))), np.ones(len(vehicles))
    for camera in np.unique(vehicles.cameras).tolist():
        rows = np.flatnonzero(vehicles.cameras == camera)
        calibration, size_px = camera_of(frame.views[camera])
        geometry = FrameGeometry(frame.stamp_s, np.eye(4), calibration.image_P_velo, size_px)
        outlines_px = box_outlines_px(geometry.image_P_velo, found.boxes, size_px)
        boxes_px = vehicles.fused.detections.boxes_px[rows]
        overlap_px[rows] = iou_px(boxes_px, np.nan_to_num(outlines_px))
        focals_px[rows] = geometry.focal_px
    overlap = np.nan_to_num(iou_bev(vehicles.boxes, found.boxes))
    types, others = vehicles.fused.detections.types, found.fused.detections.types
    is_alike = SizePriors.of(types).has_sides[:, None] == SizePriors.of(others).has_sides
    is_same = (overlap >= _MIN_IOU) | (
        (overlap_px >= _MIN_IOU_PX) & _are_as_far(vehicles, found, focals_px)
    )
    is_same &= is_alike & _are_leading(vehicles)[:, None]
    existence = vehicles.fused.existence
    costs = _MAX_COST - np.maximum(overlap_px, overlap) - existence[:, None]
    costs -= found.fused.existence
    of_found, may_be = np.ascontiguousarray(costs.T), np.ascontiguousarray(is_same.T)
    pairs = assign_sure_first(of_found, may_be, _MAX_COST, existence >= _SURE)
    return pairs.detections, pairs.tracks


def _are_leading(vehicles: Vehicles) -> Bool:
    """Return (V,) whether each vehicle is the likeliest of those that one camera has found at its place.

    Others are the same object by another class: joined with parts of what is seen from above, they would take its evidence.
    """
    boxes_px, cameras = vehicles.fused.detections.boxes_px, vehicles.cameras
    is_same = (iou_px(boxes_px, boxes_px) >= SAME_PLACE_IOU) & (cameras[:, None] == cameras)
    leaders = find_leaders(is_same, vehicles.fused.existence)
    return np.asarray(leaders == np.arange(len(leaders)))


def _are_as_far(vehicles: Vehicles, found: Vehicles, focals_px: Float64) -> Bool:
    """Return (V, M) whether vehicles in images of (V,) focal lengths are as far along the ray as objects seen from above."""
    is_located = np.isfinite(vehicles.boxes.yaw_rad)
    boxes_px = vehicles.fused.detections.boxes_px
    heights_px = np.maximum(boxes_px[:, 3] - boxes_px[:, 1], 1.0)
    assumed_m = focals_px * ASSUMED_HEIGHT_M / heights_px
    located_m, found_m = (
        np.linalg.norm(one.boxes.bottom_m[:, :2], axis=1) for one in (vehicles, found)
    )
    away_m = np.where(is_located, located_m, assumed_m)
    noise_m2 = _RAY_NOISE_M**2 + (_RAY_NOISE_SHARE * away_m) ** 2
    noise_m2 = np.where(is_located, noise_m2, (_ASSUMED_DEPTH_SHARE * away_m) ** 2)
    variances_m2 = noise_m2[:, None] + found.covariances[:, 0, 0]
    variances_m2 += np.nan_to_num(np.trace(vehicles.covariances[:, :2, :2], axis1=1, axis2=2))[
        :, None
    ]
    return np.asarray((away_m[:, None] - found_m) ** 2 <= _MAX_DEVIATIONS**2 * variances_m2)


def spreads_m2(vehicles: Vehicles) -> Float64:
    """Return (M,) stated variances of the outlines on the ground, infinite where they are not known."""
    deviations, size_m = vehicles.box_deviations, vehicles.boxes.size_m
    ends_m = np.column_stack([deviations.size_m[:, :2] / 2, deviations.yaw_rad * size_m[:, 0] / 2])
    places_m2 = np.trace(vehicles.covariances[:, :2, :2], axis1=1, axis2=2)
    return np.asarray(np.nan_to_num(places_m2 + (ends_m**2).sum(axis=1), nan=np.inf))


def _joined(vehicles: Vehicles, seen: Vehicles, rows: Int, is_better: Bool) -> Vehicles:
    """Return V vehicles, those of some rows with the evidence and, where it is better, the box of objects from above."""
    own, own_deviations = vehicles.boxes[rows], vehicles.box_deviations[rows]
    odds, evidence = log_odds(seen.fused.detections.scores, LEAST), np.zeros((2, len(vehicles)))
    constants = (_SCORE_EVIDENCE, _EXISTENCE_EVIDENCE)
    for row, (share, constant) in zip(evidence, constants, strict=True):
        row[rows] = np.maximum(share * odds + constant, 0.0)
    covariances, distances_m = vehicles.covariances.copy(), vehicles.distances_m.copy()
    covariances[rows[is_better]] = seen.covariances[is_better]
    distances_m[rows[is_better]] = seen.distances_m[is_better]
    bev_scores = np.full(len(vehicles), np.nan)
    bev_scores[rows] = seen.bev_scores
    bev_types = np.full(len(vehicles), "", seen.bev_types.dtype)
    bev_types[rows] = seen.bev_types
    # Which end is the front says the surer one, whichever box is taken.
    is_surer = seen.box_deviations.reversal < own_deviations.reversal
    ahead_rad = seen.boxes.yaw_rad + wrap(own.yaw_rad - seen.boxes.yaw_rad, np.pi)
    boxes = replace(own, yaw_rad=np.where(is_surer, wrap(ahead_rad), own.yaw_rad))
    reversal = np.where(is_surer, seen.box_deviations.reversal, own_deviations.reversal)
    deviations = replace(own_deviations, reversal=reversal)
    return replace(
        _with_evidence(vehicles, *evidence),
        boxes=vehicles.boxes.replaced(rows, boxes.replaced(is_better, seen.boxes[is_better])),
        covariances=covariances,
        box_deviations=vehicles.box_deviations.replaced(
            rows, deviations.replaced(is_better, seen.box_deviations[is_better])
        ),
        distances_m=distances_m,
        bev_scores=bev_scores,
        bev_types=bev_types,
    )


def _raised(vehicles: Vehicles, rows: Int, seen: Vehicles, unseen: Float64) -> Vehicles:
    """Return vehicles of which those of some rows exist as surely as if no image showed what is seen from above.

    A weak detection, which a camera or a map makes of most objects that it hardly shows, is no worse than none.
    """
    existence = vehicles.fused.existence.copy()
    alone = probability(log_odds(seen.fused.existence, LEAST) + unseen)
    existence[rows] = np.maximum(existence[rows], alone)
    return replace(vehicles, fused=replace(vehicles.fused, existence=existence))


def are_covered(found: Vehicles, vehicles: Vehicles) -> Bool:
    """Return (M,) whether objects from above overlap a vehicle on the ground that exists as surely."""
    overlap = np.nan_to_num(iou_bev(found.boxes, vehicles.boxes))
    overlap *= vehicles.fused.existence >= found.fused.existence[:, None]
    return np.asarray(overlap.max(axis=1, initial=0.0) >= _MIN_IOU)


def _with_evidence(vehicles: Vehicles, of_score: Float64, of_existence: Float64) -> Vehicles:
    """Return vehicles with (M,) log-odds added to their scores and to their existence."""
    fused = vehicles.fused
    scores, existence = (
        np.where(evidence == 0, one, probability(log_odds(one, LEAST) + evidence))
        for one, evidence in (
            (fused.detections.scores, of_score),
            (fused.existence, of_existence),
        )
    )
    with_scores = vehicles.with_detections(scores=scores)
    return replace(with_scores, fused=replace(with_scores.fused, existence=existence))
