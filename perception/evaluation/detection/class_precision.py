"""Average precision of object classes at several IoUs and difficulties, with its table, JSON and curves."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from perception.evaluation.detection.average_precision import match_detections
from perception.evaluation.detection.bootstrap import (
    Interval,
    PrecisionSamples,
    percentile_interval,
    resample_precision,
)
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.detection.evaluation_boxes import count_objects
from perception.evaluation.detection.precision_curve import PrecisionCurve, max_ap
from perception.evaluation.detection.protocol import DIFFICULTIES, RECALL_STEPS, DetectionClass
from perception.evaluation.report import Column, Table
from perception.render.curve_plots import CurvePanel, precision_panel
from perception.types import Float64, Progress

LEVELS = tuple(one.name for one in DIFFICULTIES)
CONFIDENCE = 0.95
PROTOCOL: Mapping[str, str] = {
    "name": "KITTI object benchmark, boxes in the image",
    "similarity": "intersection over union, areas without + 1 pixel, above the IoU of the class",
    "objects": (
        "objects of the class within the limits of the difficulty on height, occlusion and truncation; others "
        "of the class and objects of its neighbour classes are ignored"
    ),
    "detections": (
        "detections below the minimum height are ignored, of any class; an unmatched detection with more than "
        "the IoU of its area in one DontCare region is no false positive"
    ),
    "precision": "at up to 41 scores of matched objects, each the maximum over this and all higher recalls",
    "averages": "R11: recall 0, 0.1 .. 1 (before October 2019); R40: recall 1/40 .. 1 (since then)",
    "intervals": "95 % percentile intervals over bootstrap resamples of the frames",
    "truncation": (
        "of tracking labels, level 0 counts at every difficulty, levels 1 and 2 at none: of the objects in both "
        "of KITTI's benchmarks, 97 % of level 0 are truncated by 0.15 or less, 99.6 % of level 1 by more than "
        "0.5, half of level 2"
    ),
}


@dataclass(frozen=True)
class PrecisionMetrics:
    """Metrics of one class at one IoU and difficulty.

    Attributes:
        objects: Number of labelled objects that must be detected.
        curve: Precision-recall curve; None where no object of the class was detected.
        samples: Average precision of the bootstrap resamples; None without resamples.
    """

    objects: int
    curve: PrecisionCurve | None
    samples: PrecisionSamples | None = None

    @property
    def found(self) -> int | None:
        """Number of objects that are matched when all detections count; None where nothing was detected."""
        return self.curve.matches if self.curve else None

    @property
    def recall_percent(self) -> float | None:
        """Share of objects that are matched when all detections count; None of no objects or detections."""
        return 100 * self.curve.matches / self.objects if self.curve and self.objects else None

    def ap(self, recall_points: int = 40) -> float:
        """Return the average precision in percent: 0 where nothing was detected, NaN without objects."""
        if not self.objects:
            return float("nan")
        return self.curve.ap(recall_points) if self.curve else 0.0

    def max_ap(self, recall_points: int = 40) -> float | None:
        """Return the average precision in percent of a perfect detector; None without objects."""
        return max_ap(self.objects, recall_points) if self.objects else None

    def resampled_ap(self, recall_points: int = 40) -> Float64:
        """Return (N,) average precisions of the resamples in percent, NaN without an object."""
        return self.samples.percent[recall_points] if self.samples else np.zeros(0)

    def interval(self, recall_points: int = 40) -> Interval:
        """Return the 95 % interval of the average precision; NaN without resamples."""
        return percentile_interval(self.resampled_ap(recall_points), CONFIDENCE)


@dataclass(frozen=True)
class ClassPrecision:
    """Metrics of one class.

    Attributes:
        name: Name of the class.
        metrics: Metrics by IoU, then by difficulty.
    """

    name: str
    metrics: Mapping[float, Mapping[str, PrecisionMetrics]]

    @property
    def ious(self) -> tuple[float, ...]:
        """IoUs of the metrics."""
        return tuple(self.metrics)

    @property
    def first(self) -> Mapping[str, PrecisionMetrics]:
        """Metrics at the first IoU, by difficulty."""
        return next(iter(self.metrics.values()))


def measure_precision(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    detection_class: DetectionClass,
    config: PrecisionConfig,
    progress: Progress = iter,
) -> ClassPrecision:
    """Measure the detections of one class at every IoU and difficulty.

    Args:
        truths: Labelled boxes of all frames.
        detections: Detected boxes of all frames.
        frames: Number of frames, with boxes or without.
        detection_class: Class; its own IoU is used where the configuration has none.
        config: Metric configuration.
        progress: Iterates over the resamples and may show a progress bar.
    """
    objects = {
        one.name: count_objects(truths, frames, detection_class, one) for one in DIFFICULTIES
    }
    metrics: dict[float, dict[str, PrecisionMetrics]] = {}
    for iou in config.iou or (detection_class.iou,):
        statistics = match_detections(truths, detections, frames, [detection_class.at_iou(iou)])
        curves = statistics.metrics().classes[0].curves
        samples: Mapping[str, PrecisionSamples] = {}
        if config.bootstrap:
            rng = np.random.default_rng(config.seed)
            (samples,) = resample_precision(statistics, config.bootstrap, rng, progress)
        metrics[iou] = {
            level: PrecisionMetrics(objects[level], curves.get(level), samples.get(level))
            for level in LEVELS
        }
    return ClassPrecision(detection_class.name, metrics)


@dataclass(frozen=True)
class PrecisionReport:
    """Average precision of several classes: table, JSON and curves.

    Attributes:
        title: Title of the table.
        classes: Metrics of each class.
        config: Metric configuration.
        proposal_recall: Recall of the proposals in percent by IoU and difficulty, of detectors that have them.
        notes: Further lines below the table.
    """

    title: str
    classes: Sequence[ClassPrecision]
    config: PrecisionConfig
    proposal_recall: Mapping[tuple[float, str], float] = field(default_factory=dict)
    notes: Sequence[str] = ()

    def tables(self) -> Sequence[Table[Any]]:
        """Return one table with a row for each class, difficulty and IoU."""
        rows = {
            f"{one.name} {level} {iou:g}": _Row(iou, level, metrics)
            for one in self.classes
            for iou, by_level in one.metrics.items()
            for level, metrics in by_level.items()
        }
        heading = "class, difficulty, IoU"
        return [Table(self.title, self._columns(), rows, heading, list(self._notes()))]

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by class, IoU and difficulty, with the curves."""
        columns = [column for column in self._columns() if column.key is not None]
        return {
            one.name: {
                f"{iou:g}": {
                    level: {
                        **{str(c.key): c.value(_Row(iou, level, metrics)) for c in columns},
                        "curve": metrics.curve,
                    }
                    for level, metrics in by_level.items()
                }
                for iou, by_level in one.metrics.items()
            }
            for one in self.classes
        }

    def panels(self) -> list[CurvePanel]:
        """Return the precision-recall curves, a panel for each class and IoU."""
        points = self.config.recall_points[-1]
        return [
            precision_panel(
                title=f"{one.name}, IoU over {iou:g}",
                curves={
                    f"{level}: {metrics.ap(points):.1f} % of {metrics.objects}": metrics.curve.precision
                    for level, metrics in by_level.items()
                    if metrics.curve is not None
                },
                legend_title=f"average precision R{points}",
            )
            for one in self.classes
            for iou, by_level in one.metrics.items()
        ]

    def _columns(self) -> list[Column["_Row"]]:
        columns: list[Column[_Row]] = [
            Column("objects", lambda row: row.metrics.objects, key="objects"),
            *self._proposal_columns(),
            Column("found", lambda row: row.metrics.found, key="found"),
            Column("recall [%]", lambda row: row.metrics.recall_percent, ".1f", "recall_percent"),
        ]
        for points in self.config.recall_points:
            columns += _average_columns(points, has_intervals=self.config.bootstrap > 0)
            if self._has_orientation():
                columns.append(_aos_column(points))
        points = self.config.recall_points[-1]
        max_ap = partial(_max_ap, points=points)
        return [*columns, Column("max AP [%]", max_ap, ".1f", f"max_ap_r{points}_percent")]

    def _proposal_columns(self) -> list[Column["_Row"]]:
        if not self.proposal_recall:
            return []
        recall = self.proposal_recall
        return [
            Column(
                "proposal recall [%]",
                lambda row: recall.get((row.iou, row.level)),
                ".1f",
                "proposal_recall_percent",
            )
        ]

    def _metrics(self) -> Iterator[PrecisionMetrics]:
        for one in self.classes:
            for by_level in one.metrics.values():
                yield from by_level.values()

    def _has_orientation(self) -> bool:
        return any(one.curve is not None and one.curve.aos() is not None for one in self._metrics())

    def _notes(self) -> Iterator[str]:
        """Yield what the numbers do not show by themselves."""
        for one in self.classes:
            if all(metrics.curve is None for metrics in one.first.values()):
                yield f"{one.name}: nothing detected, so it has no metrics."
        objects = [metrics.objects for metrics in self._metrics() if metrics.curve is not None]
        if objects and min(objects) <= RECALL_STEPS:
            yield few_objects_note()
        yield from self.notes


def few_objects_note() -> str:
    """Return the note on classes with few objects."""
    return (
        f"With {RECALL_STEPS} objects or fewer, KITTI's protocol has fewer than {RECALL_STEPS + 1} thresholds: a "
        "perfect detector stays below 100 %, at the maximum AP."
    )


@dataclass(frozen=True)
class _Row:
    iou: float
    level: str
    metrics: PrecisionMetrics


def _average_columns(points: int, *, has_intervals: bool) -> list[Column[_Row]]:
    key = f"ap_r{points}"
    columns: list[Column[_Row]] = [
        Column(f"AP R{points} [%]", lambda row: _ap(row, points), ".2f", f"{key}_percent")
    ]
    if has_intervals:
        columns += [
            Column(
                "95 % low",
                lambda row: row.metrics.interval(points).low,
                ".2f",
                f"{key}_low_percent",
            ),
            Column(
                "95 % high",
                lambda row: row.metrics.interval(points).high,
                ".2f",
                f"{key}_high_percent",
            ),
        ]
    return columns


def _aos_column(points: int) -> Column[_Row]:
    def aos(row: _Row) -> float | None:
        curve = row.metrics.curve
        return curve.aos(points) if curve is not None and row.metrics.objects else None

    return Column(f"AOS R{points} [%]", aos, ".2f", f"aos_r{points}_percent")


def _max_ap(row: _Row, points: int) -> float | None:
    return row.metrics.max_ap(points)


def _ap(row: _Row, points: int) -> float | None:
    return row.metrics.ap(points) if row.metrics.curve is not None else None
