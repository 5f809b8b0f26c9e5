"""Which proposals are vehicles, which are not, and which had better not be learned from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from data.crops.labelled_frames import ProposalScene
from perception.detection.depthcn.windows import WindowKind
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px
from perception.types import Bool, Float64, Int

VEHICLE = "Car"
# As like a car as makes no difference; KITTI's measure does not count them either way.
_NEIGHBOUR = "Van"

_MIN_SHARE = 0.5  # of a vehicle's points
_MAX_SHARE = 0.1  # of what is none: a wall that a car touches, not one half of which is a car
_MIN_IOU, _MAX_IOU = 0.5, 0.3  # likewise, where boxes are compared
_MAX_UNLABELLED = 0.5  # of a proposal's box within a region in which nothing was labelled


@dataclass(frozen=True)
class ProposalMatches:
    """What P proposals of one frame are.

    Attributes:
        labels: (P,) row of the label that a vehicle is, -1 where it is none.
        is_left_out: (P,) neither vehicle nor surely none.
    """

    labels: Int
    is_left_out: Bool


def match_by_points(scene: ProposalScene) -> ProposalMatches:
    """Call a vehicle what has at least half of its points in a car's 3D box."""
    return _match(scene, scene.shares, _MIN_SHARE, _MAX_SHARE)


def match_by_boxes(scene: ProposalScene) -> ProposalMatches:
    """Call a vehicle what overlaps a car's 2D box well, as the thesis does."""
    return _match(scene, iou_px(scene.boxes_px, scene.label_boxes_px), _MIN_IOU, _MAX_IOU)


# What the thesis' network sees is the proposal's box, of which nothing but its box can be asked.
MATCHERS: Mapping[WindowKind, Callable[[ProposalScene], ProposalMatches]] = {
    "metric": match_by_points,
    "box": match_by_boxes,
}


def _match(scene: ProposalScene, closeness: Float64, least: float, most: float) -> ProposalMatches:
    """Match by a (P, L) measure: a vehicle from `least` on, none where it is `most` at most."""
    of_car = np.where(scene.label_types == VEHICLE, closeness, 0.0)
    of_neighbour = np.where(scene.label_types == _NEIGHBOUR, closeness, 0.0)
    closest = of_car.max(axis=1, initial=0.0)
    is_vehicle = (closest >= least) & (closest >= of_neighbour.max(axis=1, initial=0.0))
    labels = np.full(len(closest), -1)
    labels[is_vehicle] = of_car[is_vehicle].argmax(axis=1) if is_vehicle.any() else -1
    near_either = np.maximum(closest, of_neighbour.max(axis=1, initial=0.0)) > most
    unlabelled = intersection_over_area_px(scene.boxes_px, scene.dont_care_px)
    in_region = unlabelled.max(axis=1, initial=0.0) > _MAX_UNLABELLED
    return ProposalMatches(labels, np.asarray((near_either | in_region) & ~is_vehicle))
