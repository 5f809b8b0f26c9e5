"""KITTI's object benchmark at a glance: average precision in the image, from above and in space, and of orientation.

Boxes from above and in space are measured at two overlaps: the benchmark's own, and the loose one that is usual beside
it. A detector without 3D boxes is measured in the image alone.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.class_precision import (
    ClassPrecision,
    PrecisionMetrics,
    measure_precision,
)
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.detection.estimates import Estimate, EstimateRow, estimate_table
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.overlap_metric import BEV, IMAGE, SPACE
from perception.evaluation.detection.protocol import DetectionClass
from perception.evaluation.report import Report, Table
from perception.types import Progress

_HEADINGS = {metric.name: metric.heading for metric in (IMAGE, BEV, SPACE)}


@dataclass(frozen=True)
class BenchmarkScores(Report):
    """Scores of several classes.

    Attributes:
        classes: Metrics of each class by its name, then by the name of the overlap metric: `image`, `bev`, `3d`; no
            metric for which no detection of the class has a box.
        recall_points: Number of recall points over which precision is averaged.
    """

    classes: Mapping[str, Mapping[str, ClassPrecision]]
    recall_points: int = 40

    def tables(self) -> Sequence[Table[Any]]:
        """Return one table with a row for each class, metric and IoU."""
        title = f"KITTI's object benchmark: AP R{self.recall_points} [%] above an IoU"
        table = estimate_table(title, dict(self._rows()))
        return [replace(table, heading="class, boxes, IoU", notes=list(self._notes()))]

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by class, overlap metric, IoU and difficulty, with the curves."""
        return {
            name: {metric: one.to_json() for metric, one in by_metric.items()}
            for name, by_metric in self.classes.items()
        }

    def _rows(self) -> Iterator[tuple[str, EstimateRow]]:
        points = self.recall_points
        for name, by_metric in self.classes.items():
            for metric, precision in by_metric.items():
                for iou, by_level in precision.metrics.items():
                    yield f"{name} {_HEADINGS[metric]} {iou:g}", _row(by_level, _precision(points))
                    if any(one.aos(points) is not None for one in by_level.values()):
                        yield f"{name} AOS {iou:g}", _row(by_level, _orientation(points))

    def _notes(self) -> Iterator[str]:
        objects = {
            name: [one.objects for one in by_metric[IMAGE.name].first.values()]
            for name, by_metric in self.classes.items()
        }
        yield "Objects, easy / moderate / hard: " + ", ".join(
            f"{name} {' / '.join(map(str, counts))}" for name, counts in objects.items()
        )


def measure_benchmark(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    classes: Sequence[DetectionClass],
    config: PrecisionConfig,
    progress: Progress = iter,
) -> BenchmarkScores:
    """Measure the detections of some classes by every overlap metric, at the IoUs of each class.

    Args:
        truths: Labelled boxes.
        detections: Detected boxes.
        frames: Number of frames, with boxes or without.
        classes: Classes.
        config: Metric configuration, of which the IoUs are not used.
        progress: Iterates over the resamples and may show a progress bar.
    """
    scores: dict[str, dict[str, ClassPrecision]] = {one.name: {} for one in classes}
    for metric in (IMAGE, BEV, SPACE):
        boxes = pair_boxes(truths, detections, frames, metric)
        for one in classes:
            is_strict = metric is IMAGE
            ious = (one.iou,) if is_strict else tuple(dict.fromkeys((one.iou, one.loose_iou)))
            if is_strict or boxes.has_detections_of(one):
                settings = replace(config, iou=ious)
                scores[one.name][metric.name] = measure_precision(boxes, one, settings, progress)
    return BenchmarkScores(scores, config.recall_points[-1])


def _row(
    by_level: Mapping[str, PrecisionMetrics], estimate: Callable[[PrecisionMetrics], Estimate]
) -> EstimateRow:
    return {level: estimate(metrics) for level, metrics in by_level.items()}


def _precision(points: int) -> Callable[[PrecisionMetrics], Estimate]:
    return lambda metrics: Estimate(metrics.known_ap(points), metrics.interval(points))


def _orientation(points: int) -> Callable[[PrecisionMetrics], Estimate]:
    return lambda metrics: Estimate(metrics.aos(points), metrics.aos_interval(points))
