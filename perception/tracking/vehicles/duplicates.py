"""Second detections of one object, which neither begin nor continue a track."""

import numpy as np

from perception.geometry.box_overlap import iou_bev
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px
from perception.tracking.vehicles.config import DuplicateConfig
from perception.tracking.vehicles.observations import VehicleObservations
from perception.types import Bool


def is_duplicate(observations: VehicleObservations, config: DuplicateConfig) -> Bool:
    """Return (D,) whether each detection is a second one of an object that a better one has found."""
    covers = covered(observations, observations, config)
    # Detections of two cameras have been joined on the ground.
    covers &= observations.cameras[:, None] == observations.cameras
    best_first = np.argsort(-observations.detections.scores, kind="stable")
    is_single = np.zeros(len(observations), bool)
    for row in best_first.tolist():
        is_single[row] = not (covers[row] & is_single).any()
    return ~is_single


def covered(
    observations: VehicleObservations, others: VehicleObservations, config: DuplicateConfig
) -> Bool:
    """Return (D, O) whether each detection shows the object of another one.

    Cars in a row overlap in the image as much as two boxes of one car do: returns tell them apart.
    """
    found_px, others_px = observations.detections.boxes_px, others.detections.boxes_px
    overlap = iou_px(found_px, others_px)
    is_within = intersection_over_area_px(found_px, others_px) >= config.min_share
    # Returns decide between boxes that overlap in the image; most rows have no such partner but themselves.
    is_near = overlap >= config.min_iou
    found = observations.is_located & (is_near.sum(axis=1) > 1)
    other = others.is_located & (is_near.sum(axis=0) > 1)
    is_apart = np.zeros(overlap.shape, bool)
    is_apart[np.ix_(found, other)] = (
        iou_bev(observations.boxes_world[found], others.boxes_world[other]) <= 0
    )
    return np.asarray(
        (overlap >= np.where(is_apart, config.min_iou_apart, config.min_iou))
        | (is_within & ~observations.is_located[:, None])
    )
