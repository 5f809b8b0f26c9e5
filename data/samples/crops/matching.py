"""Matching of proposals to labels: objects of the classes, others, and those that are left out of training."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from data.samples.crops.labelled_frames import ProposalScene
from perception.detection.depthcn.windows import WindowKind
from perception.evaluation.detection.protocol import kitti_class
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px
from perception.types import Bool, Float64, Int

_MIN_SHARE = 0.5  # of an object's points within the label
_MAX_SHARE = 0.1  # of a negative's: a wall that a car touches, but not half a car
_MIN_IOU, _MAX_IOU = 0.5, 0.3  # the same for 2D boxes
_MAX_UNLABELLED = 0.5  # of a proposal's box within a DontCare region


@dataclass(frozen=True)
class ProposalMatches:
    """Labels of the P proposals of one frame.

    Attributes:
        labels: (P,) row of the matching label, -1 of others.
        is_left_out: (P,) mask of the ambiguous, which are neither positives nor negatives.
    """

    labels: Int
    is_left_out: Bool


def match_by_points(scene: ProposalScene, classes: Sequence[str]) -> ProposalMatches:
    """Match proposals with at least half of their points in the 3D box of an object of the classes."""
    return _match(scene, classes, scene.shares, (_MIN_SHARE, _MAX_SHARE))


def match_by_boxes(scene: ProposalScene, classes: Sequence[str]) -> ProposalMatches:
    """Match proposals by the IoU of 2D boxes, as the thesis does."""
    overlap = iou_px(scene.boxes_px, scene.label_boxes_px)
    return _match(scene, classes, overlap, (_MIN_IOU, _MAX_IOU))


# The thesis' network sees the proposal's box alone, so that only boxes can be compared.
MATCHERS: Mapping[WindowKind, Callable[[ProposalScene, Sequence[str]], ProposalMatches]] = {
    "metric": match_by_points,
    "box": match_by_boxes,
}


def _match(
    scene: ProposalScene, classes: Sequence[str], overlap: Float64, limits: tuple[float, float]
) -> ProposalMatches:
    """Match by a (P, L) overlap: positives from the first limit on, negatives up to the second."""
    positive, negative = limits
    # Too similar to be negatives; KITTI's benchmark does not count them either way.
    neighbours = {name for one in classes for name in kitti_class(one).neighbours} - {*classes}
    of_class = np.where(np.isin(scene.label_types, classes), overlap, 0.0)
    of_neighbour = np.where(np.isin(scene.label_types, [*neighbours]), overlap, 0.0)
    best = of_class.max(axis=1, initial=0.0)
    is_object = (best >= positive) & (best >= of_neighbour.max(axis=1, initial=0.0))
    labels = np.full(len(best), -1)
    labels[is_object] = of_class[is_object].argmax(axis=1) if is_object.any() else -1
    near_either = np.maximum(best, of_neighbour.max(axis=1, initial=0.0)) > negative
    unlabelled = intersection_over_area_px(scene.boxes_px, scene.dont_care_px)
    in_region = unlabelled.max(axis=1, initial=0.0) > _MAX_UNLABELLED
    return ProposalMatches(labels, np.asarray((near_either | in_region) & ~is_object))
