"""Average precision of object classes at several IoUs and difficulties, with its table, JSON and curves."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np

from perception.evaluation.detection.average_precision import (
    Interval,
    PrecisionCurve,
    PrecisionSamples,
    match_detections,
    max_ap,
    percentile_interval,
    resample_precision,
)
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.detection.evaluation_boxes import (
    EvaluationBoxes,
    evaluation_mask,
    pair_boxes,
)
from perception.evaluation.detection.protocol import (
    DIFFICULTIES,
    LEVELS,
    RECALL_STEPS,
    DetectionClass,
)
from perception.evaluation.report import Column, Metrics, Report, Table
from perception.render.curve_plots import CurvePanel, precision_panel
from perception.types import Detections, Float64, Labels, Progress

Output = TypeVar("Output")

CONFIDENCE = 0.95
_OPTIONAL = ("proposal", "95 %", "AOS")  # columns without a value in any row are not printed


@dataclass(frozen=True)
class PrecisionMetrics(Metrics):
    """Metrics of one class at one IoU and difficulty.

    Attributes:
        objects: Number of labelled objects that must be detected.
        recall_points: Number of recall points over which precision is averaged, one or several.
        curve: Precision-recall curve; None where no object of the class was detected.
        samples: Average precision of the bootstrap resamples; None without resamples.
        proposal_recall_percent: Share of the objects that a proposal recalls; None of a detector without proposals.
    """

    objects: int
    recall_points: tuple[int, ...]
    curve: PrecisionCurve | None
    samples: PrecisionSamples | None = None
    proposal_recall_percent: float | None = None

    @property
    def found(self) -> int | None:
        """Number of objects that are matched when all detections count; None where nothing was detected."""
        return self.curve.matches if self.curve else None

    @property
    def recall_percent(self) -> float | None:
        """Share of objects that are matched when all detections count; None of no objects or detections."""
        return 100 * self.curve.matches / self.objects if self.curve and self.objects else None

    def ap(self, points: int = 40) -> float:
        """Return the average precision in percent: 0 where nothing was detected, NaN without objects."""
        if not self.objects:
            return float("nan")
        return self.curve.ap(points) if self.curve else 0.0

    def known_ap(self, points: int = 40) -> float | None:
        """Return the average precision in percent; None where nothing was detected or there are no objects."""
        return self.curve.ap(points) if self.curve and self.objects else None

    def aos(self, points: int = 40) -> float | None:
        """Return the average orientation similarity in percent; None without headings or objects."""
        return self.curve.aos(points) if self.curve and self.objects else None

    def max_ap(self, points: int = 40) -> float | None:
        """Return the average precision in percent of a perfect detector; None without objects."""
        return max_ap(self.objects, points) if self.objects else None

    def resampled_ap(self, points: int = 40) -> Float64:
        """Return (N,) average precisions of the resamples in percent, NaN without an object."""
        return self.samples.ap[points] if self.samples else np.zeros(0)

    def interval(self, points: int = 40) -> Interval:
        """Return the 95 % interval of the average precision; NaN without resamples."""
        return percentile_interval(self.resampled_ap(points), CONFIDENCE)

    def aos_interval(self, points: int = 40) -> Interval:
        """Return the 95 % interval of the average orientation similarity; NaN without resamples."""
        return percentile_interval(
            self.samples.aos[points] if self.samples else np.zeros(0), CONFIDENCE
        )

    def to_json(self) -> dict[str, Any]:
        """Return the values of all columns, and the curve."""
        columns = precision_columns(self.recall_points)
        return {**{str(one.key): one.value(self) for one in columns}, "curve": self.curve}


@dataclass(frozen=True)
class ClassPrecision(Metrics):
    """Metrics of one class.

    Attributes:
        name: Name of the class.
        metrics: Metrics by IoU, then by difficulty.
    """

    name: str
    metrics: Mapping[float, Mapping[str, PrecisionMetrics]]

    @property
    def first(self) -> Mapping[str, PrecisionMetrics]:
        """Metrics at the first IoU, by difficulty."""
        return next(iter(self.metrics.values()))

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by IoU and difficulty."""
        return {
            f"{iou:g}": {level: one.to_json() for level, one in by_level.items()}
            for iou, by_level in self.metrics.items()
        }


def measure_precision(
    boxes: EvaluationBoxes,
    detection_class: DetectionClass,
    config: PrecisionConfig,
    progress: Progress = iter,
) -> ClassPrecision:
    """Measure the detections of one class at every IoU and difficulty.

    Args:
        boxes: Boxes of all frames.
        detection_class: Class; its own IoU is used where the configuration has none.
        config: Metric configuration.
        progress: Iterates over the resamples and may show a progress bar.
    """
    masks = {one.name: evaluation_mask(boxes, detection_class, one) for one in DIFFICULTIES}
    objects = {name: int(one.is_valid_truth.sum()) for name, one in masks.items()}
    metrics: dict[float, dict[str, PrecisionMetrics]] = {}
    for iou in config.iou or (detection_class.iou,):
        (matches,) = match_detections(boxes, [detection_class.at_iou(iou)]).values()
        curves = matches.curves()
        samples: Mapping[str, PrecisionSamples] = {}
        if config.bootstrap:
            rng = np.random.default_rng(config.seed)
            samples = resample_precision(matches, config.bootstrap, rng, progress)
        metrics[iou] = {
            level: PrecisionMetrics(
                objects[level], config.recall_points, curves.get(level), samples.get(level)
            )
            for level in LEVELS
        }
    return ClassPrecision(detection_class.name, metrics)


def precision_columns(recall_points: Sequence[int]) -> list[Column[PrecisionMetrics]]:
    """Return the columns of average precision, of which table and JSON document are made."""
    # fmt: off
    columns: list[Column[PrecisionMetrics]] = [
        Column("objects", lambda row: row.objects, key="objects"),
        Column("proposal recall [%]", lambda row: row.proposal_recall_percent, ".1f", "proposal_recall_percent"),
        Column("found", lambda row: row.found, key="found"),
        Column("recall [%]", lambda row: row.recall_percent, ".1f", "recall_percent"),
    ]
    # fmt: on
    for points in recall_points:
        columns += _average_columns(points)
    last = recall_points[-1]
    max_key = f"max_ap_r{last}_percent"
    return [*columns, Column("max AP [%]", lambda row: row.max_ap(last), ".1f", max_key)]


def level_columns() -> list[Column[Mapping[str, float]]]:
    """Return a column for each difficulty, of rows that hold the average precision by its name."""
    return [_level_column(level) for level in LEVELS]


def _level_column(level: str) -> Column[Mapping[str, float]]:
    return Column(level, lambda row: row.get(level), ".2f", level)


def _average_columns(points: int) -> list[Column[PrecisionMetrics]]:
    key = f"ap_r{points}"
    return [
        Column(f"AP R{points} [%]", lambda row: row.known_ap(points), ".2f", f"{key}_percent"),
        Column("95 % low", lambda row: row.interval(points).low, ".2f", f"{key}_low_percent"),
        Column("95 % high", lambda row: row.interval(points).high, ".2f", f"{key}_high_percent"),
        Column(f"AOS R{points} [%]", lambda row: row.aos(points), ".2f", f"aos_r{points}_percent"),
    ]


@dataclass
class PrecisionMeasure(Generic[Output]):
    """Base of the measures that compare the output of a detector with the labels, frame by frame.

    Attributes:
        classes: Classes that are measured.
        config: Metric configuration.
        progress: Iterates over the resamples and may show a progress bar.
        outputs: Output of the detector of each frame so far.
        labels: Labels of each frame so far.
    """

    classes: Sequence[DetectionClass]
    config: PrecisionConfig
    progress: Progress = iter
    outputs: list[Output] = field(default_factory=list, init=False)
    labels: list[Labels] = field(default_factory=list, init=False)

    def update(self, output: Output, labels: Labels) -> None:
        """Add one frame."""
        self.outputs.append(output)
        self.labels.append(labels)

    @property
    def truths(self) -> TrueBoxes:
        """Labelled boxes of all frames so far."""
        return TrueBoxes.of_frames(self.labels)

    def detected(self, detections_of: Callable[[Output], Detections]) -> DetectedBoxes:
        """Return the detections of all frames so far, as a function makes them of an output."""
        return DetectedBoxes.of_frames([detections_of(output) for output in self.outputs])

    def pair(self, detections: DetectedBoxes) -> EvaluationBoxes:
        """Return the labelled boxes of all frames so far, paired with detections."""
        return pair_boxes(self.truths, detections, len(self.outputs))

    def precision(
        self, detections: DetectedBoxes, config: PrecisionConfig | None = None
    ) -> list[ClassPrecision]:
        """Return the metrics of the detections of each class."""
        boxes, settings = self.pair(detections), config or self.config
        return [measure_precision(boxes, one, settings, self.progress) for one in self.classes]


@dataclass(frozen=True)
class PrecisionReport(Report):
    """Average precision of several classes: table, JSON and curves.

    Attributes:
        title: Title of the table.
        classes: Metrics of each class.
        notes: Further lines below the table.
        benchmark: Scores of KITTI's benchmark, whose table comes first; None where they are not measured.
    """

    title: str
    classes: Sequence[ClassPrecision]
    notes: Sequence[str] = ()
    benchmark: Report | None = None

    @property
    def by_class(self) -> Mapping[str, ClassPrecision]:
        """Metrics of each class by its name."""
        return {one.name: one for one in self.classes}

    def tables(self) -> Sequence[Table[Any]]:
        """Return the benchmark's table, and one with a row for each class, difficulty and IoU in the image."""
        rows = {
            f"{one.name} {level} {iou:g}": metrics
            for one in self.classes
            for iou, by_level in one.metrics.items()
            for level, metrics in by_level.items()
        }
        columns = [
            column
            for column in precision_columns(self._recall_points)
            if not column.name.startswith(_OPTIONAL)
            or any(column.cell(row) != "-" for row in rows.values())
        ]
        notes = [*self._notes(rows.values()), *self.notes]
        first = self.benchmark.tables() if self.benchmark else []
        return [*first, Table(self.title, columns, rows, "class, difficulty, IoU", notes)]

    def to_json(self) -> dict[str, Any]:
        """Return the benchmark's scores, and the metrics by class, IoU and difficulty, with the curves."""
        first = {"benchmark": self.benchmark.to_json()} if self.benchmark else {}
        return {**first, **{one.name: one.to_json() for one in self.classes}}

    def panels(self) -> list[CurvePanel]:
        """Return the precision-recall curves, a panel for each class and IoU."""
        points = self._recall_points[-1]
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

    @property
    def _recall_points(self) -> tuple[int, ...]:
        return next(iter(self.classes[0].first.values())).recall_points

    def _notes(self, rows: Iterable[PrecisionMetrics]) -> Iterator[str]:
        absent, missed = [], []
        for one in self.classes:
            metrics = one.first.values()
            if not any(row.objects for row in metrics):
                absent.append(one.name)
            elif all(row.curve is None for row in metrics):
                missed.append(one.name)
        if absent:
            of_these = (
                "this class, so it has" if len(absent) == 1 else "these classes, so they have"
            )
            yield f"{', '.join(absent)}: no labelled object of {of_these} no metrics."
        yield from (f"{name}: nothing detected, so it has no metrics." for name in missed)
        yield from few_objects_note(row.objects for row in rows if row.curve and row.objects)


def level_panel(
    title: str, precisions: Mapping[str, ClassPrecision], level: str, iou: float
) -> CurvePanel:
    """Return the curves of several detectors or steps of one, by name, at a difficulty and an IoU."""
    at_level = {name: one.metrics[iou][level] for name, one in precisions.items()}
    curves = {
        f"{name}: {one.ap(one.recall_points[0]):.1f} %": one.curve.precision
        for name, one in at_level.items()
        if one.curve is not None
    }
    return precision_panel(title, curves, "average precision")


def few_objects_note(objects: Iterable[int]) -> Iterator[str]:
    """Yield a note where a class has few objects."""
    if min(objects, default=RECALL_STEPS + 1) <= RECALL_STEPS:
        yield (
            f"With {RECALL_STEPS} objects or fewer, KITTI's protocol has fewer than {RECALL_STEPS + 1} thresholds: "
            "a perfect detector stays below 100 %, at the maximum AP."
        )
