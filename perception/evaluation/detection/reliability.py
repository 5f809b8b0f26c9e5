"""Reliability of scores as probabilities: share of correct detections by score, expected calibration error.

M. P. Naeini, G. F. Cooper, M. Hauskrecht, "Obtaining well calibrated probabilities using Bayesian binning",
AAAI 2015. Bins have equal width.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.evaluation.detection.evaluation_boxes import EvaluationBoxes
from perception.evaluation.detection.protocol import DetectionClass
from perception.evaluation.report import Metric, Metrics
from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class Correctness:
    """D detections, each correct or not.

    Attributes:
        scores: (D,) scores.
        is_correct: (D,) mask of the detections that match an object.
    """

    scores: Float64
    is_correct: Bool


@dataclass(frozen=True)
class Reliability(Metrics):
    """Detections in B bins of their scores, without empty bins.

    Attributes:
        scores: (B,) mean score of each bin.
        shares: (B,) share of correct detections of each bin, 0 to 1.
        counts: (B,) number of detections of each bin.
    """

    scores: Float64
    shares: Float64
    counts: Int

    @property
    def expected_calibration_error(self) -> Annotated[float, Metric("ECE", ".3f")]:
        """Mean difference of score and share of correct detections over all detections; NaN of none."""
        if not len(self.counts):
            return float("nan")
        return float(np.average(np.abs(self.scores - self.shares), weights=self.counts))


def match_correctness(boxes: EvaluationBoxes, detection_class: DetectionClass) -> Correctness:
    """Return which detections of a class are correct; an object is matched once, by the highest score.

    Detections of neighbour classes and in DontCare regions are neither right nor wrong, and left out.
    """
    is_of_class = boxes.detection_types == detection_class.name.lower()
    is_correct = _matched(boxes, detection_class, is_of_class)
    neighbours = [name.lower() for name in detection_class.neighbours]
    pairs = boxes.overlaps
    is_neighbour = np.isin(boxes.truth_types[pairs.truths], neighbours) & (
        pairs.iou > detection_class.iou
    )
    is_left_out = boxes.dont_care_shares > detection_class.iou
    is_left_out[pairs.detections[is_neighbour]] = True
    counts = is_of_class & (is_correct | ~is_left_out)
    return Correctness(boxes.detections.scores[counts], is_correct[counts])


def measure_reliability(found: Correctness, bins: int = 15) -> Reliability:
    """Return the reliability of scores from 0 to 1 in bins of equal width."""
    bin_of = np.clip((found.scores * bins).astype(np.int64), 0, bins - 1)
    counts = np.bincount(bin_of, minlength=bins)
    is_filled = counts > 0
    scores = np.bincount(bin_of, found.scores, bins)[is_filled] / counts[is_filled]
    shares = np.bincount(bin_of, found.is_correct, bins)[is_filled] / counts[is_filled]
    return Reliability(scores, shares, counts[is_filled])


def _matched(boxes: EvaluationBoxes, detection_class: DetectionClass, is_of_class: Bool) -> Bool:
    """Return (D,) the detections matched greedily: highest score first, then largest IoU."""
    pairs = boxes.overlaps
    is_pair = (
        (pairs.iou > detection_class.iou)
        & (boxes.truth_types[pairs.truths] == detection_class.name.lower())
        & is_of_class[pairs.detections]
    )
    pairs = pairs[is_pair]
    order = np.lexsort((-pairs.iou, -boxes.detections.scores[pairs.detections]))
    is_correct = np.zeros(len(boxes.detections), bool)
    is_found = np.zeros(len(boxes.truths), bool)
    for truth, detection in zip(
        pairs.truths[order].tolist(), pairs.detections[order].tolist(), strict=True
    ):
        if not is_found[truth] and not is_correct[detection]:
            is_found[truth] = is_correct[detection] = True
    return is_correct
