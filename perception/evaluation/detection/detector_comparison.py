"""Several detectors on the same frames: a table for each class, with a row for each detector and overlap."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from perception.evaluation.detection.class_precision import (
    ClassPrecision,
    few_objects_note,
    level_panel,
)
from perception.evaluation.detection.estimates import (
    Estimate,
    EstimateRow,
    estimate_column,
    estimate_table,
)
from perception.evaluation.detection.evaluation_boxes import EvaluationBoxes
from perception.evaluation.detection.protocol import LEVELS
from perception.evaluation.report import Report, Table
from perception.render.curve_plots import CurvePanel
from perception.types import Labels

_TIME = "p50 [ms]"
_PERFECT = "perfect detector"
_LEVEL = "moderate"  # of the curves


class ComparedReport(Protocol):
    """Report of a detector that can be set beside others."""

    @property
    def by_class(self) -> Mapping[str, ClassPrecision]:
        """Metrics of each class by its name."""
        ...

    @property
    def median_frame_ms(self) -> float | None:
        """Median time of a frame in milliseconds; None where it was not measured."""
        ...

    def to_json(self) -> Any:  # noqa: ANN401 - as of any report
        """Return all metrics."""
        ...


class ComparedMeasure(Protocol):
    """Measure of a detector that can be set beside others."""

    config: Any

    def update(self, output: Any, labels: Labels) -> None:  # noqa: ANN401 - of its detector
        """Add one frame."""
        ...

    def boxes(self) -> EvaluationBoxes:
        """Return the labelled and the detected boxes of all frames so far."""
        ...

    def compute(self) -> ComparedReport:
        """Return the metrics of all frames so far."""
        ...


@dataclass(frozen=True)
class DetectorComparison(Report):
    """Metrics of several detectors on one drive.

    Attributes:
        reports: Metrics of each detector by its name.
    """

    reports: Mapping[str, ComparedReport]

    def tables(self) -> Sequence[Table[Any]]:
        """Return a table for each class that some detector was measured for."""
        return [self._table(name) for name in self._class_names]

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by detector."""
        return {"detectors": {name: one.to_json() for name, one in self.reports.items()}}

    def panels(self) -> list[CurvePanel]:
        """Return the curves of all detectors, a panel for each class and IoU."""
        return [
            level_panel(f"{name}, {_LEVEL}, IoU over {iou:g}", self._of_class(name), _LEVEL, iou)
            for name in self._class_names
            for iou in next(iter(self._of_class(name).values())).metrics
        ]

    @property
    def _class_names(self) -> list[str]:
        return list(dict.fromkeys(name for one in self.reports.values() for name in one.by_class))

    def _of_class(self, name: str) -> dict[str, ClassPrecision]:
        """Return the metrics of a class by detector, of those that were measured for it."""
        return {
            detector: one.by_class[name]
            for detector, one in self.reports.items()
            if name in one.by_class
        }

    def _table(self, name: str) -> Table[Any]:
        of_class = self._of_class(name)
        first = next(iter(of_class.values()))
        (points, *_) = first.first[LEVELS[0]].recall_points
        rows = {
            f"{detector} {iou:g}": self._row(detector, one, iou)
            for iou in first.metrics
            for detector, one in of_class.items()
        }
        rows[_PERFECT] = {level: Estimate(one.max_ap(points)) for level, one in first.first.items()}
        title = f"{name}: AP R{points} [%] by detector and IoU"
        objects = {level: one.objects for level, one in first.first.items()}
        counts = "Objects: " + ", ".join(f"{count} {level}" for level, count in objects.items())
        notes = [counts, *few_objects_note(objects.values())]
        table = estimate_table(title, rows, ".2f", [estimate_column(_TIME, ".1f")])
        return replace(table, heading="detector, IoU", notes=notes)

    def _row(self, detector: str, precision: ClassPrecision, iou: float) -> EstimateRow:
        row = {_TIME: Estimate(self.reports[detector].median_frame_ms)}
        for level, one in precision.metrics[iou].items():
            (points, *_) = one.recall_points
            row[level] = Estimate(one.ap(points), one.interval(points))
        return row


@dataclass(frozen=True)
class DetectorComparisonMeasure:
    """Accumulates the output of several detectors frame by frame.

    Attributes:
        measures: Measure of each detector by its name.
    """

    measures: Mapping[str, ComparedMeasure]

    @property
    def config(self) -> Any:  # noqa: ANN401 - as of each measure
        """Metric configuration."""
        return self._first.config

    def update(self, outputs: Mapping[str, Any], labels: Labels) -> None:
        """Add one frame."""
        for name, measure in self.measures.items():
            measure.update(outputs[name], labels)

    def boxes(self) -> EvaluationBoxes:
        """Return the labelled boxes and those that the first detector found in all frames so far."""
        return self._first.boxes()

    def compute(self) -> DetectorComparison:
        """Return the metrics of all frames so far."""
        return DetectorComparison(dict(self._reports()))

    @property
    def _first(self) -> ComparedMeasure:
        return next(iter(self.measures.values()))

    def _reports(self) -> Iterator[tuple[str, ComparedReport]]:
        for name, measure in self.measures.items():
            yield name, measure.compute()
