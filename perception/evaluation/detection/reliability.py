"""Whether a score is a probability: how often detections of a score are right.

C. Guo, G. Pleiss, Y. Sun, K. Weinberger, "On calibration of modern neural networks", ICML 2017, section 2.
What is right or wrong is booked as by KITTI's measure: what need not be found is neither.
"""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.protocol import DetectionClass, Difficulty
from perception.evaluation.detection.scene import lay_out
from perception.evaluation.detection.tally import tally
from perception.types import Float64

BINS = 10


@dataclass(frozen=True)
class Reliability:
    """Detections in bins of score, from 0 to 1.

    Attributes:
        counts: (B,) that are right or wrong.
        scores: (B,) their mean score; NaN of none.
        precision: (B,) the share of them that is right; NaN of none.
    """

    counts: Float64
    scores: Float64
    precision: Float64

    @property
    def expected_error(self) -> float:
        """Expected calibration error, 0 to 1: by how much score and share differ on average; NaN of none."""
        total = self.counts.sum()
        if total <= 0:
            return float("nan")
        return float(np.nansum(self.counts * np.abs(self.scores - self.precision)) / total)


def measure_reliability(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    of_class: DetectionClass,
    difficulty: Difficulty,
) -> Reliability:
    """Compare the scores of a class, which lie from 0 to 1, with how often they are right.

    Raises:
        PerceptionError: a box is of a frame beyond the last.
    """
    changes = tally(lay_out(truths, detections, frames), of_class, difficulty).changes
    rows = np.clip((changes.scores * BINS).astype(np.int64), 0, BINS - 1)
    right = np.bincount(rows, changes.true_positives, BINS)
    booked = changes.true_positives + changes.false_positives
    # Where a rival takes over an object, what is booked on it is taken from another.
    counts = np.asarray(np.maximum(np.bincount(rows, booked, BINS), 0), np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        scores = np.bincount(rows, booked * changes.scores, BINS) / counts
        precision = right / counts
    is_empty = counts == 0
    return Reliability(
        counts=counts,
        scores=np.where(is_empty, np.nan, scores),
        precision=np.where(is_empty, np.nan, precision),
    )
