"""Metrics of a single detector: average precision, recall of its proposals, and time per frame."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from perception.evaluation.detection.benchmark_scores import measure_benchmark
from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.evaluation.detection.class_precision import (
    ClassPrecision,
    PrecisionMeasure,
    PrecisionReport,
)
from perception.evaluation.detection.evaluation_boxes import EvaluationBoxes
from perception.evaluation.detection.proposal_recall import ProposalRecall, proposal_recall
from perception.evaluation.report import Table
from perception.evaluation.stage_times import median_frame_s, stage_table
from perception.types import Detections, Float64


@dataclass(frozen=True)
class FrameDetections:
    """Output of one detector for one frame.

    Attributes:
        detections: Objects of all classes, best first.
        timings_s: Time of each stage in seconds.
        proposals_px: (P, 4) boxes before verification; None of a detector without proposals.
    """

    detections: Detections
    timings_s: Mapping[str, float]
    proposals_px: Float64 | None = None


@dataclass(frozen=True)
class DetectorReport(PrecisionReport):
    """Metrics of a detector on one drive.

    Attributes:
        seconds: (F,) time of each stage in all frames, in seconds.
        proposals_per_frame: Mean number of proposals; None of a detector without proposals.
    """

    seconds: Mapping[str, Float64] = field(default_factory=dict)
    proposals_per_frame: float | None = None

    @property
    def median_frame_ms(self) -> float:
        """Median time of a frame in milliseconds."""
        return self._frame_ms()["p50"]

    def median_ms(self, stage: str) -> float:
        """Return the median time of a stage in milliseconds."""
        return 1e3 * float(np.median(self.seconds[stage]))

    def tables(self) -> Sequence[Table[Any]]:
        """Return the table of average precision, with the times below it."""
        *first, table = super().tables()
        note = ", ".join(f"{name} {ms:.1f} ms/frame" for name, ms in self._frame_ms().items())
        if self.proposals_per_frame is not None:
            note += f", {self.proposals_per_frame:.1f} proposals/frame"
        return [*first, replace(table, notes=[*table.notes, note])]

    def to_json(self) -> dict[str, Any]:
        """Return all metrics."""
        return {
            "ms_per_frame": self._frame_ms(),
            "proposals_per_frame": self.proposals_per_frame,
            "benchmark": self.benchmark and self.benchmark.to_json(),
            "classes": {one.name: one.to_json() for one in self.classes},
        }

    def _frame_ms(self) -> dict[str, float]:
        frame_ms = 1e3 * np.sum(list(self.seconds.values()), axis=0)
        return {"p50": float(np.median(frame_ms)), "p99": float(np.percentile(frame_ms, 99))}


@dataclass(kw_only=True)
class DetectorMeasure(PrecisionMeasure[FrameDetections]):
    """Accumulates the detections of one detector frame by frame.

    Attributes:
        title: Title of the report.
        notes: Lines below the table.
    """

    title: str
    notes: Sequence[str] = ()

    def boxes(self) -> EvaluationBoxes:
        """Return the labelled and the detected boxes of all frames so far."""
        return self.pair(self.detected(lambda output: output.detections))

    def compute(self) -> DetectorReport:
        """Return the metrics of all frames so far."""
        detections = self.detected(lambda output: output.detections)
        classes, recall = self.precision(detections), None
        name, ious = self.classes[0].name, self.config.iou
        proposals = [one.proposals_px for one in self.outputs if one.proposals_px is not None]
        if proposals:
            boxes = DetectedBoxes.of_frames([_unscored(one, name) for one in proposals])
            recall = proposal_recall(self.pair(boxes), name, ious)
            classes[0] = _with_recall(classes[0], recall)
        seconds = {
            stage: np.array([output.timings_s[stage] for output in self.outputs])
            for stage in self.outputs[0].timings_s
        }
        per_frame = recall.proposals_per_frame if recall else None
        scores = measure_benchmark(
            self.truths, detections, len(self.outputs), self.classes, self.config, self.progress
        )
        return DetectorReport(self.title, classes, self.notes, scores, seconds, per_frame)


def _with_recall(precision: ClassPrecision, recall: ProposalRecall) -> ClassPrecision:
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


@dataclass
class DetectorSummary:
    """Counts and times over the frames of a drive.

    Attributes:
        name: Name of the drive.
        display_score: Score from which a detection is counted as displayed.
        network: Metadata of the network.
        seconds: Time by stage, one entry a frame.
        counts: Number of proposals, detections and displayed detections, one entry a frame.
        elapsed_s: Wall time with reading, drawing and writing.
    """

    name: str
    display_score: float
    network: dict[str, str]
    seconds: dict[str, list[float]] = field(default_factory=dict)
    counts: list[tuple[int, int, int]] = field(default_factory=list)
    elapsed_s: float = 0.0

    def add(self, output: FrameDetections) -> None:
        """Add one frame."""
        for stage, seconds in output.timings_s.items():
            self.seconds.setdefault(stage, []).append(seconds)
        found, proposals = output.detections, output.proposals_px
        displayed = int((found.scores >= self.display_score).sum())
        self.counts.append((0 if proposals is None else len(proposals), len(found), displayed))

    def text(self) -> str:
        """Return the times of the stages and the counts."""
        frames = len(self.counts)
        if not frames:
            return f"{self.name}: no frame could be read"
        table = stage_table(f"{self.name}: {frames} frames", self.seconds).text()
        proposals, detections, displayed = (sum(one) / frames for one in self._columns())
        return (
            f"{table}\n\n{proposals:.1f} proposals/frame, {detections:.1f} detections/frame, {displayed:.1f} of "
            f"these with a score of {self.display_score:g} or more; {1 / median_frame_s(self.seconds):.0f} frames/s "
            f"for the stages, {frames / self.elapsed_s:.1f} with reading, drawing and writing"
        )

    def to_json(self) -> dict[str, Any]:
        """Return the same for summary.json."""
        proposals, detections, displayed = map(sum, self._columns())
        return {
            "drive": self.name,
            "frames": len(self.counts),
            "elapsed_s": round(self.elapsed_s, 3),
            "stages_ms": stage_table("", self.seconds).to_json(),
            "proposals": proposals,
            "detections": detections,
            "network": self.network,
            "displayed": {"display_score": self.display_score, "detections": displayed},
        }

    def _columns(self) -> list[tuple[int, ...]]:
        return list(zip(*self.counts, strict=True)) or [(), (), ()]
