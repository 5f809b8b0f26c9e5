"""KITTI's 2D tracking protocol: the boxes of a class that are evaluated, frame by frame.

Ignored are truncated or occluded true boxes, those of a similar class, and the predictions matched to them;
also unmatched predictions that are too low, or that lie in a region without labels.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from scipy.optimize import linear_sum_assignment

from perception.errors import PerceptionError, UsageError
from perception.evaluation.multi_object.sequence import TrackedFrame
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px
from perception.types import ArrayTable, Bool, Float64, Int

KittiClass = Literal["car", "pedestrian", "cyclist"]
# Class: similar classes, all in lower case.
NEIGHBOURS: dict[KittiClass, tuple[str, ...]] = {
    "car": ("van",),
    "pedestrian": ("person", "person_sitting"),
    "cyclist": (),
}
MIN_IOU = 0.5  # overlap in the image from which on a prediction is matched to a true box
MAX_TRUNCATION = 0  # level of true boxes that are evaluated
MAX_OCCLUSION = 2  # level of true boxes that are evaluated
_MIN_HEIGHT_PX = 25.0  # that an unmatched prediction must exceed to be false
_MAX_DONT_CARE = 0.5  # share of its area that a false one may have in one DontCare region
_DONT_CARE = "dontcare"
_ROUNDING = np.finfo(np.float64).eps


@dataclass(frozen=True)
class ImageBoxes(ArrayTable):
    """N labelled or predicted boxes of a sequence, in any order.

    Attributes:
        frames: (N,) Number of the frame, from 0.
        ids: (N,) Track id, below 0 where a row has no track.
        types: (N,) Class name in any case.
        truncation: (N,) Level; not read from predictions.
        occlusion: (N,) Level; not read from predictions.
        boxes_px: (N, 4) Box x1 y1 x2 y2.
    """

    frames: Int
    ids: Int
    types: np.ndarray
    truncation: Float64
    occlusion: Float64
    boxes_px: Annotated[Float64, 4]


def kitti_frames(
    truth: ImageBoxes, predictions: ImageBoxes, class_name: KittiClass, frame_count: int
) -> list[TrackedFrame]:
    """Return the evaluated boxes of each frame with their IoU in the image.

    Args:
        truth: Labels of all classes, with regions of type DontCare.
        predictions: Boxes of a tracker.
        class_name: Class that is evaluated, "car", "pedestrian" or "cyclist".
        frame_count: Number of frames of the sequence.
    """
    if class_name not in NEIGHBOURS:
        known = ", ".join(NEIGHBOURS)
        raise UsageError("class", expected=f"one of {known}", found=repr(class_name))
    true_types, predicted_types = np.char.lower(truth.types), np.char.lower(predictions.types)
    near = np.isin(true_types, (class_name, *NEIGHBOURS[class_name])) & (truth.ids >= 0)
    predicted = (predicted_types == class_name) & (predictions.ids >= 0)
    is_evaluated = (true_types == class_name) & is_visible(truth.truncation, truth.occlusion)
    slices = zip(
        _by_frame(truth.frames, near, frame_count),
        _by_frame(truth.frames, true_types == _DONT_CARE, frame_count),
        _by_frame(predictions.frames, predicted, frame_count),
        strict=True,
    )
    return [
        evaluated_boxes(
            truth[true],
            is_evaluated[true],
            predictions[given],
            truth.boxes_px[regions],
            iou_px(truth.boxes_px[true], predictions.boxes_px[given]),
        )
        for true, regions, given in slices
    ]


def _by_frame(frames: Int, mask: Bool, frame_count: int) -> Iterator[Int]:
    """Yield the rows of each frame that a mask selects."""
    rows = np.flatnonzero(mask)
    if len(rows) and not 0 <= frames[rows].min() <= frames[rows].max() < frame_count:
        raise PerceptionError(
            "frames of boxes",
            expected=f"0 to {frame_count - 1}",
            found=f"{frames[rows].min()} to {frames[rows].max()}",
        )
    rows = rows[np.argsort(frames[rows], kind="stable")]
    ends = np.searchsorted(frames[rows], np.arange(frame_count + 1))
    return (rows[start:end] for start, end in pairwise(ends))


def is_visible(truncation: Float64, occlusion: Float64 | Int) -> Bool:
    """Return whether true boxes are evaluated by their levels of truncation and occlusion."""
    return np.asarray((truncation <= MAX_TRUNCATION) & (occlusion <= MAX_OCCLUSION))


def evaluated_boxes(
    truth: ImageBoxes,
    is_evaluated: Bool,
    predictions: ImageBoxes,
    regions_px: Float64,
    overlap: Float64,
    min_overlap: float = MIN_IOU,
) -> TrackedFrame:
    """Leave out the boxes of one frame that are neither right nor wrong.

    Args:
        truth: G true boxes of a class and of similar ones.
        is_evaluated: (G,) whether a true box is evaluated; else it and its match are ignored.
        predictions: T predicted boxes of the class.
        regions_px: (R, 4) regions in the image without labels.
        overlap: (G, T) overlap of the boxes, in the image or on the ground.
        min_overlap: Minimum overlap of a match.
    """
    boxes_px = predictions.boxes_px
    is_near = overlap >= min_overlap - _ROUNDING
    rows, columns = linear_sum_assignment(np.where(is_near, overlap, 0), maximize=True)
    is_pair = is_near[rows, columns]
    rows, columns = rows[is_pair], columns[is_pair]
    is_low = boxes_px[:, 3] - boxes_px[:, 1] <= _MIN_HEIGHT_PX
    share = intersection_over_area_px(boxes_px, regions_px)
    counts = ~is_low & ~(share > _MAX_DONT_CARE + _ROUNDING).any(axis=1)
    # A matched prediction is evaluated if its true box is, whatever its height and position.
    counts[columns] = is_evaluated[rows]
    return TrackedFrame(
        truth.ids[is_evaluated], predictions.ids[counts], overlap[is_evaluated][:, counts]
    )
