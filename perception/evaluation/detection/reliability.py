"""Do scores say how often detections are right: reliability, and the calibration error expected of a score.

M. P. Naeini, G. F. Cooper, M. Hauskrecht, "Obtaining well calibrated probabilities using Bayesian binning",
AAAI 2015. Bins are of equal width here.
"""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import EvaluationBoxes, pair_boxes
from perception.evaluation.detection.protocol import DetectionClass
from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class Correctness:
    """Of D detections that are either right or wrong.

    Attributes:
        scores: (D,)
        is_correct: (D,) the best of those that overlap an object by enough.
    """

    scores: Float64
    is_correct: Bool


@dataclass(frozen=True)
class Reliability:
    """Detections in B bins of their scores, empty bins left out.

    Attributes:
        scores: (B,) mean of each bin.
        shares: (B,) of its detections that are right.
        counts: (B,) how many they are.
    """

    scores: Float64
    shares: Float64
    counts: Int

    @property
    def expected_calibration_error(self) -> float:
        """The mean difference between score and share that is right, over all detections; NaN of none."""
        if not len(self.counts):
            return float("nan")
        return float(np.average(np.abs(self.scores - self.shares), weights=self.counts))


def match_correctness(
    truths: TrueBoxes, detections: DetectedBoxes, frames: int, of_class: DetectionClass
) -> Correctness:
    """Tell which detections of a class are right; an object is found once, by the best that overlaps it.

    Detections of alike types and in regions without labels are neither right nor wrong, and left out.

    Raises:
        PerceptionError: a box is of a frame beyond the last.
    """
    evaluation_boxes = pair_boxes(truths, detections, frames)
    is_of_class = evaluation_boxes.detection_types == of_class.name.lower()
    is_correct = _matched(evaluation_boxes, of_class, is_of_class)
    alike = [name.lower() for name in of_class.neighbours]
    pairs = evaluation_boxes.overlaps
    is_alike = np.isin(evaluation_boxes.truth_types[pairs.truths], alike) & (
        pairs.iou > of_class.iou
    )
    is_left_out = evaluation_boxes.dont_care_shares > of_class.iou
    is_left_out[pairs.detections[is_alike]] = True
    counts = is_of_class & (is_correct | ~is_left_out)
    return Correctness(evaluation_boxes.detections.scores[counts], is_correct[counts])


def measure_reliability(found: Correctness, bins: int = 15) -> Reliability:
    """Put detections with scores from 0 to 1 into bins."""
    bin_of = np.clip((found.scores * bins).astype(np.int64), 0, bins - 1)
    counts = np.bincount(bin_of, minlength=bins)
    is_filled = counts > 0
    scores = np.bincount(bin_of, found.scores, bins)[is_filled] / counts[is_filled]
    shares = np.bincount(bin_of, found.is_correct, bins)[is_filled] / counts[is_filled]
    return Reliability(scores, shares, counts[is_filled])


def _matched(
    evaluation_boxes: EvaluationBoxes, of_class: DetectionClass, is_of_class: Bool
) -> Bool:
    """Return (D,) which detections are the first to reach a free object, surest and tightest first."""
    pairs = evaluation_boxes.overlaps
    is_pair = (
        (pairs.iou > of_class.iou)
        & (evaluation_boxes.truth_types[pairs.truths] == of_class.name.lower())
        & is_of_class[pairs.detections]
    )
    pairs = pairs[is_pair]
    order = np.lexsort((-pairs.iou, -evaluation_boxes.detections.scores[pairs.detections]))
    is_correct = np.zeros(len(evaluation_boxes.detections), bool)
    is_found = np.zeros(len(evaluation_boxes.truths), bool)
    for truth, detection in zip(
        pairs.truths[order].tolist(), pairs.detections[order].tolist(), strict=True
    ):
        if not is_found[truth] and not is_correct[detection]:
            is_found[truth] = is_correct[detection] = True
    return is_correct
