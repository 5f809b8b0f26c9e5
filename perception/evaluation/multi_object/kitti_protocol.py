"""KITTI's 2D tracking protocol: the boxes of a class that are evaluated, frame by frame.

Ignored are truncated or occluded true boxes, those of a similar class, and the predictions matched to them;
also unmatched predictions that are too low, or that lie in a region without labels.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, Protocol

import numpy as np
from scipy.optimize import linear_sum_assignment

from perception.errors import PerceptionError, UsageError
from perception.evaluation.config import KittiTrackingConfig
from perception.evaluation.multi_object.sequence import TrackedFrame
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px
from perception.types import Bool, Float64, Int

KittiClass = Literal["car", "pedestrian", "cyclist"]
# Class: similar classes, all in lower case.
NEIGHBOURS: dict[KittiClass, tuple[str, ...]] = {
    "car": ("van",),
    "pedestrian": ("person", "person_sitting"),
    "cyclist": (),
}
_DONT_CARE = "dontcare"
_ROUNDING = np.finfo(np.float64).eps


class BoxRows(Protocol):
    """N labelled or predicted boxes of a sequence, in any order: parallel arrays."""

    @property
    def frames(self) -> Int:
        """(N,) Number of the frame, from 0."""
        ...

    @property
    def ids(self) -> Int:
        """(N,) Track id, below 0 where a row has no track."""
        ...

    @property
    def types(self) -> np.ndarray:
        """(N,) Class name in any case."""
        ...

    @property
    def truncation(self) -> Float64:
        """(N,) Level; not read from predictions."""
        ...

    @property
    def occlusion(self) -> Float64:
        """(N,) Level; not read from predictions."""
        ...

    @property
    def boxes_px(self) -> Float64:
        """(N, 4) Box x1 y1 x2 y2."""
        ...


def kitti_frames(
    truth: BoxRows,
    predictions: BoxRows,
    class_name: KittiClass,
    frame_count: int,
    config: KittiTrackingConfig | None = None,
) -> list[TrackedFrame]:
    """Return the evaluated boxes of each frame with their IoU in the image.

    Args:
        truth: Labels of all classes, with regions of type DontCare.
        predictions: Boxes of a tracker.
        class_name: Class that is evaluated, "car", "pedestrian" or "cyclist".
        frame_count: Number of frames of the sequence.
        config: Thresholds of the benchmark.
    """
    config = config or KittiTrackingConfig()
    if class_name not in NEIGHBOURS:
        known = ", ".join(NEIGHBOURS)
        raise UsageError("class", expected=f"one of {known}", found=repr(class_name))
    true_types, predicted_types = np.char.lower(truth.types), np.char.lower(predictions.types)
    near = np.isin(true_types, (class_name, *NEIGHBOURS[class_name])) & (truth.ids >= 0)
    predicted = (predicted_types == class_name) & (predictions.ids >= 0)
    is_evaluated = (
        (true_types == class_name)
        & (truth.truncation <= config.max_truncation)
        & (truth.occlusion <= config.max_occlusion)
    )
    slices = zip(
        _by_frame(truth.frames, near, frame_count),
        _by_frame(truth.frames, true_types == _DONT_CARE, frame_count),
        _by_frame(predictions.frames, predicted, frame_count),
        strict=True,
    )
    return [
        _exclude_ignored(
            _TrueBoxes(truth.ids[true], truth.boxes_px[true], is_evaluated[true]),
            truth.boxes_px[regions],
            predictions.ids[given],
            predictions.boxes_px[given],
            config,
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


@dataclass(frozen=True)
class _TrueBoxes:
    """The true boxes of a class and its neighbours in one frame."""

    ids: Int
    boxes_px: Float64
    is_evaluated: Bool


def _exclude_ignored(
    true: _TrueBoxes, regions_px: Float64, ids: Int, boxes_px: Float64, config: KittiTrackingConfig
) -> TrackedFrame:
    """Leave out the boxes that are neither right nor wrong."""
    iou = iou_px(true.boxes_px, boxes_px)
    is_near = iou >= config.min_iou - _ROUNDING
    rows, columns = linear_sum_assignment(np.where(is_near, iou, 0), maximize=True)
    is_pair = is_near[rows, columns]
    rows, columns = rows[is_pair], columns[is_pair]
    is_low = boxes_px[:, 3] - boxes_px[:, 1] <= config.min_height_px
    share = intersection_over_area_px(boxes_px, regions_px)
    counts_unmatched = ~is_low & ~(share > config.max_dont_care + _ROUNDING).any(axis=1)
    # A matched prediction is evaluated if its true box is, whatever its height and position.
    is_evaluated = counts_unmatched
    is_evaluated[columns] = true.is_evaluated[rows]
    return TrackedFrame(
        true.ids[true.is_evaluated], ids[is_evaluated], iou[true.is_evaluated][:, is_evaluated]
    )
