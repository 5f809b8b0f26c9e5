"""All boxes of all frames, and how they overlap: what every class and difficulty is measured on."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from perception.errors import PerceptionError
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.grouping import pairs_in_groups
from perception.evaluation.detection.protocol import (
    DONT_CARE,
    NO_ALPHA_RAD,
    DetectionClass,
    Difficulty,
)
from perception.evaluation.rows import Rows
from perception.geometry.box_overlap_px import paired_intersection_over_area_px, paired_iou_px
from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class OverlapPairs(Rows):
    """P pairs of a labelled and a detected box of one frame that share an area.

    Attributes:
        truths: (P,) row of the labelled box.
        detections: (P,) row of the detected box.
        iou: (P,) above 0.
    """

    truths: Int
    detections: Int
    iou: Float64


@dataclass(frozen=True)
class EvaluationBoxes:
    """What does not depend on the class that is looked for.

    Attributes:
        truths: (G) labelled boxes.
        detections: (D) detected boxes.
        frames: how many there are, with boxes or without.
        truth_types: (G,) in lower case.
        detection_types: (D,) in lower case.
        overlaps: (P) in the order of the labelled boxes.
        dont_care_shares: (D,) of each detection's area, the most that lies in a single DontCare box.
    """

    truths: TrueBoxes
    detections: DetectedBoxes
    frames: int
    truth_types: np.ndarray
    detection_types: np.ndarray
    overlaps: OverlapPairs
    dont_care_shares: Float64

    @property
    def has_orientation(self) -> bool:
        """Whether the heading of every detection, of whatever class, is told."""
        return not (self.detections.alphas_rad == NO_ALPHA_RAD).any()

    def has_detections_of(self, of_class: DetectionClass) -> bool:
        """Tell whether there is any detection of a class, as the official tool looks for one."""
        is_of_class = self.detection_types == of_class.name.lower()
        return bool((is_of_class & (self.detections.boxes_px[:, 0] >= 0)).any())


def pair_boxes(truths: TrueBoxes, detections: DetectedBoxes, frames: int) -> EvaluationBoxes:
    """Find all overlaps once.

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
        truth_types=truth_types,
        detection_types=np.char.lower(detections.types.astype(np.str_)),
        overlaps=_find_overlaps(truths, detections),
        dont_care_shares=_dont_care_shares(truths[truth_types == DONT_CARE], detections),
    )


def _find_overlaps(truths: TrueBoxes, detections: DetectedBoxes) -> OverlapPairs:
    of_truths, of_detections = pairs_in_groups(truths.frames, detections.frames)
    iou = paired_iou_px(truths.boxes_px[of_truths], detections.boxes_px[of_detections])
    return OverlapPairs(of_truths, of_detections, iou)[iou > 0]


def _dont_care_shares(regions: TrueBoxes, detections: DetectedBoxes) -> Float64:
    of_regions, of_detections = pairs_in_groups(regions.frames, detections.frames)
    pairs_px = detections.boxes_px[of_detections], regions.boxes_px[of_regions]
    shares = np.zeros(len(detections))
    np.maximum.at(shares, of_detections, paired_intersection_over_area_px(*pairs_px))
    return shares


@dataclass(frozen=True)
class EvaluationMask:
    """Who counts for one class at one difficulty. Who is wanted but not valid or normal is ignored.

    Attributes:
        is_matchable_truth: (G,) of the class or a neighbour.
        is_valid_truth: (G,) must be found.
        is_matchable_detection: (D,) may be matched.
        is_valid_detection: (D,) is right if matched to a valid truth.
        is_false_positive_if_unmatched: (D,) is wrong if matched to nothing: normal, and outside of DontCare.
    """

    is_matchable_truth: Bool
    is_valid_truth: Bool
    is_matchable_detection: Bool
    is_valid_detection: Bool
    is_false_positive_if_unmatched: Bool


def evaluation_mask(
    evaluation_boxes: EvaluationBoxes, of_class: DetectionClass, difficulty: Difficulty
) -> EvaluationMask:
    """Decide who counts."""
    truths, detections = evaluation_boxes.truths, evaluation_boxes.detections
    is_of_class = evaluation_boxes.truth_types == of_class.name.lower()
    is_visible = (
        (truths.occlusion <= difficulty.max_occlusion)
        & (truths.truncation <= difficulty.max_truncation)
        & (_heights_px(truths.boxes_px) > difficulty.min_height_px)
    )
    # The height of a detection is asked first, its class only then: what is too low may be of any.
    is_low = np.abs(_heights_px(detections.boxes_px)) < difficulty.min_height_px
    is_valid_detection = ~is_low & (evaluation_boxes.detection_types == of_class.name.lower())
    return EvaluationMask(
        is_matchable_truth=is_of_class
        | _is_any_of(evaluation_boxes.truth_types, of_class.neighbours),
        is_valid_truth=is_of_class & is_visible,
        is_matchable_detection=is_low | is_valid_detection,
        is_valid_detection=is_valid_detection,
        is_false_positive_if_unmatched=is_valid_detection
        & (evaluation_boxes.dont_care_shares <= of_class.iou),
    )


def count_objects(
    truths: TrueBoxes, frames: int, of_class: DetectionClass, difficulty: Difficulty
) -> int:
    """Return how many objects must be found, whatever was detected.

    Raises:
        PerceptionError: a box is of a frame beyond the last.
    """
    evaluation_boxes = pair_boxes(truths, DetectedBoxes.of_frames(()), frames)
    return int(evaluation_mask(evaluation_boxes, of_class, difficulty).is_valid_truth.sum())


def _heights_px(boxes_px: Float64) -> Float64:
    return np.asarray(boxes_px[:, 3] - boxes_px[:, 1])


def _is_any_of(types: np.ndarray, names: Iterable[str]) -> Bool:
    return np.isin(types, [name.lower() for name in names])
