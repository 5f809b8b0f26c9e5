"""Counts of right and wrong points, for people and for programs."""

from collections.abc import Mapping
from dataclasses import asdict

from perception.cli.table import Cell, format_table
from perception.evaluation.confusion import Confusion


def confusion_table(title: str, counts: Mapping[str, Confusion]) -> str:
    """Return one row of ratios for each name; the true points are those that were to be found."""
    rows: list[list[Cell]] = [
        [name, c.precision, c.recall, c.f1, c.iou, c.true_positives + c.false_negatives]
        for name, c in counts.items()
    ]
    return format_table(title, ("", "precision", "recall", "F1", "IoU", "true points"), rows)


def confusion_metrics(counts: Confusion) -> dict[str, float]:
    """Return the counts and the ratios made of them."""
    return {
        **asdict(counts),
        "precision": counts.precision,
        "recall": counts.recall,
        "f1": counts.f1,
        "iou": counts.iou,
    }
