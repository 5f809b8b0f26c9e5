"""Confusion counts of a binary classification of points, and the ratios made of them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Self

import numpy as np

from perception.evaluation.report import Column, Table
from perception.types import Bool


@dataclass(frozen=True)
class Confusion:
    """Counts of predictions against targets; the counts of several frames are added.

    Attributes:
        true_positives: Number of positive points predicted positive.
        false_positives: Number of negative points predicted positive.
        false_negatives: Number of positive points predicted negative.
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
        """Share of the positive predictions that are right; NaN without any."""
        return _ratio(self.true_positives, self.true_positives + self.false_positives)

    @property
    def recall(self) -> float:
        """Share of the positive points that were found; NaN without any."""
        return _ratio(self.true_positives, self.true_positives + self.false_negatives)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall."""
        wrong = self.false_positives + self.false_negatives
        return _ratio(2 * self.true_positives, 2 * self.true_positives + wrong)

    @property
    def iou(self) -> float:
        """Intersection over union of the predicted and the true points."""
        wrong = self.false_positives + self.false_negatives
        return _ratio(self.true_positives, self.true_positives + wrong)

    def to_json(self) -> dict[str, float]:
        """Return the counts and the ratios by name."""
        ratios = {
            "precision": self.precision,
            "recall": self.recall,
            "f1": self.f1,
            "iou": self.iou,
        }
        return {**asdict(self), **ratios}


_COLUMNS = (
    Column[Confusion]("precision", lambda c: c.precision, ".3f"),
    Column[Confusion]("recall", lambda c: c.recall, ".3f"),
    Column[Confusion]("F1", lambda c: c.f1, ".3f"),
    Column[Confusion]("IoU", lambda c: c.iou, ".3f"),
    Column[Confusion]("true points", lambda c: c.true_positives + c.false_negatives),
)


def confusion_table(title: str, counts: Mapping[str, Confusion]) -> Table[Confusion]:
    """Return the table of several counts by name."""
    return Table(title, _COLUMNS, counts)


def confusion(predicted: Bool, target: Bool) -> Confusion:
    """Count (N,) predictions against (N,) targets."""
    return Confusion(
        int(np.count_nonzero(predicted & target)),
        int(np.count_nonzero(predicted & ~target)),
        int(np.count_nonzero(~predicted & target)),
    )


def _ratio(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")
