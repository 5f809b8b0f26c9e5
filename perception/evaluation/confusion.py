"""Confusion counts of a binary classification of points, and the ratios made of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.evaluation.report import Metric, SummedMetrics
from perception.types import Bool


@dataclass(frozen=True)
class Confusion(SummedMetrics):
    """Counts of predictions against targets; the counts of several frames are added.

    Attributes:
        true_positives: Number of positive points predicted positive.
        false_positives: Number of negative points predicted positive.
        false_negatives: Number of positive points predicted negative.
    """

    true_positives: int = 0
    false_positives: int = 0
    false_negatives: int = 0

    @property
    def precision(self) -> Annotated[float, Metric("precision", ".3f")]:
        """Share of the positive predictions that are right; NaN without any."""
        return _ratio(self.true_positives, self.true_positives + self.false_positives)

    @property
    def recall(self) -> Annotated[float, Metric("recall", ".3f")]:
        """Share of the positive points that were found; NaN without any."""
        return _ratio(self.true_positives, self.true_points)

    @property
    def f1(self) -> Annotated[float, Metric("F1", ".3f")]:
        """Harmonic mean of precision and recall."""
        wrong = self.false_positives + self.false_negatives
        return _ratio(2 * self.true_positives, 2 * self.true_positives + wrong)

    @property
    def iou(self) -> Annotated[float, Metric("IoU", ".3f")]:
        """Intersection over union of the predicted and the true points."""
        wrong = self.false_positives + self.false_negatives
        return _ratio(self.true_positives, self.true_positives + wrong)

    @property
    def true_points(self) -> Annotated[int, Metric("true points")]:
        """Number of positive points."""
        return self.true_positives + self.false_negatives


def confusion(predicted: Bool, target: Bool) -> Confusion:
    """Count (N,) predictions against (N,) targets."""
    return Confusion(
        int(np.count_nonzero(predicted & target)),
        int(np.count_nonzero(predicted & ~target)),
        int(np.count_nonzero(~predicted & target)),
    )


def add_confusions(
    total: Mapping[str, Confusion], added: Mapping[str, Confusion]
) -> dict[str, Confusion]:
    """Add counts by name."""
    return {name: total.get(name, Confusion()) + counts for name, counts in added.items()}


def _ratio(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")
