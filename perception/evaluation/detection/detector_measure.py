"""Metrics of a single detector: average precision, recall of its proposals, and time a frame."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.class_precision import (
    ClassPrecision,
    PrecisionReport,
    measure_precision,
)
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.detection.proposal_recall import ProposalRecall, proposal_recall
from perception.evaluation.detection.protocol import DetectionClass
from perception.evaluation.report import Table
from perception.render.curve_plots import CurvePanel
from perception.types import Detections, Float64, Labels, Progress


@dataclass(frozen=True)
class FrameDetections:
    """Output of one detector for one frame.

    Attributes:
        detections: Objects of all classes, best first.
        timings_s: Time of each stage.
        proposals_px: (P, 4) boxes before verification; None of a detector without proposals.
    """

    detections: Detections
    timings_s: Mapping[str, float]
    proposals_px: Float64 | None = None


@dataclass(frozen=True)
class DetectorReport:
    """Metrics of a detector on one drive.

    Attributes:
        precision: Average precision of each class.
        seconds: (F,) time of each stage; of all frames.
        proposals_per_frame: Mean number of proposals; None of a detector without proposals.
    """

    precision: PrecisionReport
    seconds: Mapping[str, Float64]
    proposals_per_frame: float | None = None

    @property
    def frame_ms(self) -> Float64:
        """(F,) time of all stages."""
        return np.asarray(1e3 * np.sum(list(self.seconds.values()), axis=0))

    def median_ms(self, stage: str) -> float:
        """Return the median time of a stage."""
        return 1e3 * float(np.median(self.seconds[stage]))

    def tables(self) -> Sequence[Table[Any]]:
        """Return the table of average precision, with the times below it."""
        (table,) = self.precision.tables()
        times = [f"p50 {np.median(self.frame_ms):.1f} ms/frame, p99 {self._p99_ms():.1f} ms/frame"]
        if self.proposals_per_frame is not None:
            times.append(f"{self.proposals_per_frame:.1f} proposals/frame")
        notes = [*table.notes, ", ".join(times)]
        return [Table(table.title, table.columns, table.rows, table.heading, notes)]

    def to_json(self) -> dict[str, Any]:
        """Return all metrics."""
        return {
            "ms_per_frame": {"p50": float(np.median(self.frame_ms)), "p99": self._p99_ms()},
            "proposals_per_frame": self.proposals_per_frame,
            "classes": self.precision.to_json(),
        }

    def panels(self) -> list[CurvePanel]:
        """Return the precision-recall curves."""
        return self.precision.panels()

    def _p99_ms(self) -> float:
        return float(np.percentile(self.frame_ms, 99))


class DetectorMeasure:
    """Accumulates the detections of one detector frame by frame."""

    def __init__(
        self,
        title: str,
        classes: Sequence[DetectionClass],
        config: PrecisionConfig,
        notes: Sequence[str] = (),
        progress: Progress = iter,
    ) -> None:
        """Start without a frame.

        Args:
            title: Title of the report.
            classes: Classes that are measured.
            config: Metric configuration.
            notes: Lines below the table.
            progress: Iterates over the resamples and may show a progress bar.
        """
        self._title, self._classes, self._config = title, tuple(classes), config
        self._notes, self._progress = notes, progress
        self._outputs: list[FrameDetections] = []
        self._labels: list[Labels] = []

    def update(self, output: FrameDetections, labels: Labels) -> None:
        """Add one frame."""
        self._outputs.append(output)
        self._labels.append(labels)

    def boxes(self) -> tuple[TrueBoxes, DetectedBoxes]:
        """Return the labelled and the detected boxes of all frames so far."""
        return TrueBoxes.of_frames(self._labels), DetectedBoxes.of_frames(
            [output.detections for output in self._outputs]
        )

    def compute(self) -> DetectorReport:
        """Return the metrics of all frames so far."""
        truths, detections = self.boxes()
        frames = len(self._outputs)
        classes = [
            measure_precision(truths, detections, frames, one, self._config, self._progress)
            for one in self._classes
        ]
        stages = self._outputs[0].timings_s
        seconds = {
            name: np.array([output.timings_s[name] for output in self._outputs]) for name in stages
        }
        proposals = [
            _unscored(output.proposals_px, self._classes[0].name)
            for output in self._outputs
            if output.proposals_px is not None
        ]
        if not proposals:
            report = PrecisionReport(self._title, classes, self._config, self._notes)
            return DetectorReport(report, seconds)
        recall = proposal_recall(
            truths, DetectedBoxes.of_frames(proposals), frames, classes[0].name, self._config.iou
        )
        classes[0] = _with_recall(classes[0], recall)
        report = PrecisionReport(self._title, classes, self._config, self._notes)
        return DetectorReport(report, seconds, recall.proposals_per_frame)


def _with_recall(precision: ClassPrecision, recall: ProposalRecall) -> ClassPrecision:
    """Return the metrics of a class with the recall of the proposals."""
    metrics = {
        iou: {
            level: replace(
                one, proposal_recall_percent=100 * recall.difficulties[level].recall(iou)
            )
            for level, one in by_level.items()
        }
        for iou, by_level in precision.metrics.items()
    }
    return replace(precision, metrics=metrics)


def _unscored(boxes_px: Float64, name: str) -> Detections:
    return Detections(boxes_px, np.zeros(len(boxes_px)), np.full(len(boxes_px), name))
