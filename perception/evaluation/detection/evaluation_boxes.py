"""Labelled and detected boxes of all frames with their overlaps by a metric, and the boxes that count for a class."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from perception.errors import PerceptionError
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.overlap_metric import IMAGE, OverlapMetric
from perception.evaluation.detection.protocol import (
    DONT_CARE,
    NO_ALPHA_RAD,
    DetectionClass,
    Difficulty,
)
from perception.evaluation.grouping import pairs_in_groups
from perception.types import ArrayTable, Bool, Float64, Int


@dataclass(frozen=True)
class OverlapPairs(ArrayTable):
    """P overlapping pairs of a labelled and a detected box of one frame.

    Attributes:
        truths: (P,) row of the labelled box.
        detections: (P,) row of the detected box.
        iou: (P,) intersection over union, above 0.
    """

    truths: Int
    detections: Int
    iou: Float64


@dataclass(frozen=True)
class EvaluationBoxes:
    """Boxes of all classes and frames.

    Attributes:
        truths: (G) labelled boxes.
        detections: (D) detected boxes.
        frames: Number of frames, with boxes or without.
        metric: Overlap by which detections match objects.
        truth_types: (G,) classes of the labels in lower case.
        detection_types: (D,) classes of the detections in lower case.
        overlaps: (P) overlapping pairs in the order of the labelled boxes.
        dont_care_shares: (D,) maximum share of each detection's size in a single DontCare box, 0 to 1.
    """

    truths: TrueBoxes
    detections: DetectedBoxes
    frames: int
    metric: OverlapMetric[Any]
    truth_types: np.ndarray
    detection_types: np.ndarray
    overlaps: OverlapPairs
    dont_care_shares: Float64

    @property
    def has_orientation(self) -> bool:
        """Whether orientation belongs to the metric, and every detection, of any class, has a heading."""
        has_headings = not (self.detections.alphas_rad == NO_ALPHA_RAD).any()
        return self.metric.has_orientation and has_headings

    def has_detections_of(self, detection_class: DetectionClass) -> bool:
        """Return whether the class has a detection that the metric applies to."""
        is_of_class = self.detection_types == detection_class.name.lower()
        return bool((is_of_class & self.metric.are_known(self.detections)).any())


def pair_boxes(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    metric: OverlapMetric[Any] = IMAGE,
) -> EvaluationBoxes:
    """Find all overlapping pairs.

    Args:
        truths: Labelled boxes.
        detections: Detected boxes.
        frames: Number of frames, with boxes or without.
        metric: Overlap by which detections match objects.

    Raises:
        PerceptionError: a box is of a frame beyond the last.
    """
    last = max(truths.frames.max(initial=0), detections.frames.max(initial=0))
    if last >= max(frames, 1):
        raise PerceptionError("frames", expected=f"below {frames}", found=f"frame {last}")
    truth_types = np.char.lower(truths.types.astype(np.str_))
    return EvaluationBoxes(
        truths=truths,
        detections=detections,
        frames=frames,
        metric=metric,
        truth_types=truth_types,
        detection_types=np.char.lower(detections.types.astype(np.str_)),
        overlaps=_find_overlaps(truths, detections, metric),
        dont_care_shares=_dont_care_shares(truths[truth_types == DONT_CARE], detections, metric),
    )


def _find_overlaps(
    truths: TrueBoxes, detections: DetectedBoxes, metric: OverlapMetric[Any]
) -> OverlapPairs:
    of_truths, of_detections = pairs_in_groups(truths.frames, detections.frames)
    iou = metric.ious(metric.shapes(truths)[of_truths], metric.shapes(detections)[of_detections])
    return OverlapPairs(of_truths, of_detections, iou)[iou > 0]


def _dont_care_shares(
    regions: TrueBoxes, detections: DetectedBoxes, metric: OverlapMetric[Any]
) -> Float64:
    of_regions, of_detections = pairs_in_groups(regions.frames, detections.frames)
    boxes = metric.shapes(detections)[of_detections], metric.shapes(regions)[of_regions]
    shares = np.zeros(len(detections))
    np.maximum.at(shares, of_detections, metric.shares(*boxes))
    return shares


@dataclass(frozen=True)
class EvaluationMask:
    """Masks of the boxes that count for one class at one difficulty.

    A box that is matchable but not valid is ignored: neither right nor wrong.

    Attributes:
        is_matchable_truth: (G,) labels of the class or of a neighbour class.
        is_valid_truth: (G,) labels that must be detected.
        is_matchable_detection: (D,) detections that may be matched.
        is_valid_detection: (D,) detections that are true positives if matched with a valid label.
        is_false_positive_if_unmatched: (D,) valid detections outside of DontCare.
    """

    is_matchable_truth: Bool
    is_valid_truth: Bool
    is_matchable_detection: Bool
    is_valid_detection: Bool
    is_false_positive_if_unmatched: Bool


def evaluation_mask(
    boxes: EvaluationBoxes, detection_class: DetectionClass, difficulty: Difficulty
) -> EvaluationMask:
    """Return which boxes count for one class at one difficulty."""
    truths, detections = boxes.truths, boxes.detections
    is_of_class = boxes.truth_types == detection_class.name.lower()
    is_visible = (
        (truths.occlusion <= difficulty.max_occlusion)
        & (truths.truncation <= difficulty.max_truncation)
        & (_heights_px(truths.boxes_px) > difficulty.min_height_px)
    )
    # The official tool checks the height before the class: low detections of any class are ignored.
    is_low = np.abs(_heights_px(detections.boxes_px)) < difficulty.min_height_px
    is_valid_detection = ~is_low & (boxes.detection_types == detection_class.name.lower())
    return EvaluationMask(
        is_matchable_truth=is_of_class | _is_any_of(boxes.truth_types, detection_class.neighbours),
        is_valid_truth=is_of_class & is_visible,
        is_matchable_detection=is_low | is_valid_detection,
        is_valid_detection=is_valid_detection,
        is_false_positive_if_unmatched=is_valid_detection
        & (boxes.dont_care_shares <= detection_class.iou),
    )


def _heights_px(boxes_px: Float64) -> Float64:
    return np.asarray(boxes_px[:, 3] - boxes_px[:, 1])


def _is_any_of(types: np.ndarray, names: Iterable[str]) -> Bool:
    return np.isin(types, [name.lower() for name in names])
