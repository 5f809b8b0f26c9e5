"""Tracks on the ground plane, of every class: KITTI's rules of what is ignored, with the overlap of boxes seen from above."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from perception.evaluation.multi_object.kitti_protocol import (
    MAX_OCCLUSION,
    ImageBoxes,
    evaluated_boxes,
    is_visible,
)
from perception.evaluation.multi_object.sequence import TrackedFrame
from perception.geometry.box_overlap import iou_bev
from perception.geometry.boxes import points_inside
from perception.types import ArrayTable, Boxes3D, Float, Float64, Int, Labels

REACH_M = 50.0  # from the LiDAR over the ground, to which objects all round count


@dataclass(frozen=True)
class GroundClass:
    """A class that is evaluated on the ground.

    Attributes:
        similar: Classes that are ignored, as are the tracks matched to them.
        min_iou: Minimum overlap from above, the loose one of KITTI's bird's-eye benchmark.
    """

    similar: tuple[str, ...]
    min_iou: float


GROUND_CLASSES: Mapping[str, GroundClass] = {
    "Car": GroundClass(("Van",), 0.5),
    "Van": GroundClass(("Car", "Truck"), 0.5),
    "Truck": GroundClass(("Van", "Tram"), 0.5),
    "Pedestrian": GroundClass(("Person_sitting", "Person"), 0.25),
    "Cyclist": GroundClass((), 0.25),
}


@dataclass(frozen=True)
class GroundTracks(ArrayTable):
    """T tracked boxes of one frame in the LiDAR frame.

    Attributes:
        ids: (T,) track ids.
        types: (T,) class names, spelled as in labels.
        boxes: (T) boxes without NaN.
        boxes_px: (T, 4) boxes in the image, by which tracks in regions without labels are ignored; NaN all round.
    """

    ids: Int
    types: NDArray[np.str_]
    boxes: Boxes3D
    boxes_px: Annotated[Float64, 4]


def ground_frame(labels: Labels, tracks: GroundTracks, class_name: str) -> TrackedFrame:
    """Return the evaluated boxes of one frame with their overlap from above.

    Args:
        labels: Labels of all classes with track ids.
        tracks: Tracks of all classes.
        class_name: Class that is evaluated, of `GROUND_CLASSES`.
    """
    rule = GROUND_CLASSES[class_name]
    is_near = np.isin(labels.types, (class_name, *rule.similar)) & (labels.track_ids >= 0)
    true, found = labels[is_near], tracks[tracks.types == class_name]
    is_evaluated = (true.types == class_name) & is_visible(true.truncation, true.occlusion)
    unknown, frames = np.full(len(found), -1.0), np.zeros(len(found), np.int64)
    return evaluated_boxes(
        ImageBoxes(
            np.zeros(len(true), np.int64),
            true.track_ids,
            true.types,
            true.truncation,
            true.occlusion.astype(np.float64),
            true.boxes_px,
        ),
        is_evaluated,
        ImageBoxes(frames, found.ids, found.types, unknown, unknown, found.boxes_px),
        labels.dont_care_px,
        iou_bev(true.boxes_velo, found.boxes),
        rule.min_iou,
    )


def measured_objects(around: Labels, points_velo: Float) -> Labels:
    """Return the labels of objects around of which those count that the LiDAR measures and that are near enough.

    Args:
        around: Labels of all objects around.
        points_velo: (N, 3+) points of the scan in the LiDAR frame.
    """
    has_points = points_inside(around.boxes_velo, points_velo).any(axis=1)
    counts = has_points & _are_near(around.boxes_velo)
    return replace(around, occlusion=np.where(counts, 0, MAX_OCCLUSION + 1))


def tracks_around(tracks: GroundTracks) -> GroundTracks:
    """Return the tracks that are near enough, whether an image shows them or not."""
    return replace(tracks, boxes_px=np.full_like(tracks.boxes_px, np.nan))[_are_near(tracks.boxes)]


def _are_near(boxes: Boxes3D) -> NDArray[np.bool_]:
    return np.asarray(np.hypot(boxes.bottom_m[:, 0], boxes.bottom_m[:, 1]) <= REACH_M)
