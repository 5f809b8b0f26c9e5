"""Counts of right and wrong points, and the four ratios made of them."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.types import Bool


@dataclass(frozen=True)
class Confusion:
    """How a yes-or-no answer for each point compares with the truth; add them up over frames.

    Attributes:
        true_positives: answered yes, is yes.
        false_positives: answered yes, is no.
        false_negatives: answered no, is yes.
    """

    true_positives: int = 0
    false_positives: int = 0
    false_negatives: int = 0

    def __add__(self, other: Self) -> "Confusion":
        """Return the counts of both."""
        return Confusion(
            self.true_positives + other.true_positives,
            self.false_positives + other.false_positives,
            self.false_negatives + other.false_negatives,
        )

    @property
    def precision(self) -> float:
        """Share of the yes answers that are right; NaN without any."""
        return _ratio(self.true_positives, self.true_positives + self.false_positives)

    @property
    def recall(self) -> float:
        """Share of the true points that were found; NaN without any."""
        return _ratio(self.true_positives, self.true_positives + self.false_negatives)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall."""
        wrong = self.false_positives + self.false_negatives
        return _ratio(2 * self.true_positives, 2 * self.true_positives + wrong)

    @property
    def iou(self) -> float:
        """Intersection over union of the answered and the true points."""
        wrong = self.false_positives + self.false_negatives
        return _ratio(self.true_positives, self.true_positives + wrong)


def confusion(predicted: Bool, target: Bool) -> Confusion:
    """Count (N,) answers against (N,) truths."""
    return Confusion(
        int(np.count_nonzero(predicted & target)),
        int(np.count_nonzero(predicted & ~target)),
        int(np.count_nonzero(~predicted & target)),
    )


def _ratio(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")
