"""Matching of proposals to labels: vehicles, others, and those that are left out of training."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from data.samples.crops.labelled_frames import ProposalScene
from perception.detection.depthcn.windows import WindowKind
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px
from perception.types import Bool, Float64, Int

VEHICLE = "Car"
# Too similar to cars to be negatives; KITTI's benchmark does not count them either way.
_NEIGHBOUR = "Van"

_MIN_SHARE = 0.5  # of a vehicle's points within the label
_MAX_SHARE = 0.1  # of a negative's: a wall that a car touches, but not half a car
_MIN_IOU, _MAX_IOU = 0.5, 0.3  # the same for 2D boxes
_MAX_UNLABELLED = 0.5  # of a proposal's box within a DontCare region


@dataclass(frozen=True)
class ProposalMatches:
    """Labels of the P proposals of one frame.

    Attributes:
        labels: (P,) row of the matching vehicle label, -1 of others.
        is_left_out: (P,) mask of the ambiguous, which are neither positives nor negatives.
    """

    labels: Int
    is_left_out: Bool


def match_by_points(scene: ProposalScene) -> ProposalMatches:
    """Match proposals with at positive half of their points in a car's 3D box."""
    return _match(scene, scene.shares, _MIN_SHARE, _MAX_SHARE)


def match_by_boxes(scene: ProposalScene) -> ProposalMatches:
    """Match proposals by the IoU of 2D boxes, as the thesis does."""
    return _match(scene, iou_px(scene.boxes_px, scene.label_boxes_px), _MIN_IOU, _MAX_IOU)


# The thesis' network sees the proposal's box alone, so that only boxes can be compared.
MATCHERS: Mapping[WindowKind, Callable[[ProposalScene], ProposalMatches]] = {
    "metric": match_by_points,
    "box": match_by_boxes,
}


def _match(
    scene: ProposalScene, overlap: Float64, positive: float, negative: float
) -> ProposalMatches:
    """Match by a (P, L) overlap: positives from `positive` on, negatives up to `negative`."""
    of_car = np.where(scene.label_types == VEHICLE, overlap, 0.0)
    of_neighbour = np.where(scene.label_types == _NEIGHBOUR, overlap, 0.0)
    best = of_car.max(axis=1, initial=0.0)
    is_vehicle = (best >= positive) & (best >= of_neighbour.max(axis=1, initial=0.0))
    labels = np.full(len(best), -1)
    labels[is_vehicle] = of_car[is_vehicle].argmax(axis=1) if is_vehicle.any() else -1
    near_either = np.maximum(best, of_neighbour.max(axis=1, initial=0.0)) > negative
    unlabelled = intersection_over_area_px(scene.boxes_px, scene.dont_care_px)
    in_region = unlabelled.max(axis=1, initial=0.0) > _MAX_UNLABELLED
    return ProposalMatches(labels, np.asarray((near_either | in_region) & ~is_vehicle))
