"""The figures of `trifuse evaluate detection`, for people and for programs."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from perception.cli.table import Cell, format_table
from perception.evaluation.detection.average_precision import ClassMetrics, DetectionMetrics
from perception.evaluation.detection.bootstrap import PrecisionSamples
from perception.evaluation.detection.precision_curve import PrecisionCurve, RecallPoints
from perception.evaluation.detection.protocol import RECALL_STEPS
from perception.render.curve_plots import CurvePanel, precision_panel

CONFIDENCE = 0.95


@dataclass(frozen=True)
class DetectionReport:
    """What the detections of all frames are worth.

    Attributes:
        metrics: of all classes at all difficulties.
        samples: on other choices of the frames: for each class, by difficulty; empty if not asked for.
        recall_points: over how many recall points, one average after the other.
    """

    metrics: DetectionMetrics
    samples: tuple[dict[str, PrecisionSamples], ...]
    recall_points: tuple[RecallPoints, ...]

    def rows(self) -> Iterator[tuple[ClassMetrics, str, PrecisionSamples | None]]:
        """Yield each class at each difficulty that has figures."""
        samples = self.samples or ({},) * len(self.metrics.classes)
        for metrics, of_class in zip(self.metrics.classes, samples, strict=True):
            for difficulty in metrics.curves:
                yield metrics, difficulty, of_class.get(difficulty)


def detection_table(report: DetectionReport) -> str:
    """Return one row for each class and difficulty, and what one has to know of them."""
    averages = [name for points in report.recall_points for name in _columns(report, points)]
    header = ("", "IoU", "truths", "found", *averages)
    rows: list[list[Cell]] = []
    for metrics, difficulty, samples in report.rows():
        curve = metrics.curves[difficulty]
        name = f"{metrics.of_class.name} {difficulty}"
        cells: list[Cell] = [name, f"{metrics.of_class.iou:g}", curve.truths, curve.matches]
        rows.append([*cells, *_averages(report, curve, samples)])
    title = f"Average precision of boxes in the image [%], {report.metrics.frames} frames"
    return "\n".join([format_table(title, header, rows), *_notes(report)])


def _columns(report: DetectionReport, points: RecallPoints) -> Iterator[str]:
    yield f"AP R{points}"
    if report.samples:
        yield f"{100 * CONFIDENCE:g} % interval"
    if any(
        metrics.curves[difficulty].aos() is not None for metrics, difficulty, _ in report.rows()
    ):
        yield f"AOS R{points}"


def _averages(
    report: DetectionReport, curve: PrecisionCurve, samples: PrecisionSamples | None
) -> Iterator[Cell]:
    for points in report.recall_points:
        yield f"{curve.ap(points):.2f}"
        if samples is not None:
            interval = samples.interval(points, CONFIDENCE)
            yield f"{interval.low:.2f} to {interval.high:.2f}"
        aos = curve.aos(points)
        if aos is not None:
            yield f"{aos:.2f}"


def _notes(report: DetectionReport) -> list[str]:
    """Say what a figure does not say by itself."""
    notes = [
        f"{metrics.of_class.name}: nothing detected, so it has no figures."
        for metrics in report.metrics.classes
        if not metrics.curves
    ]
    truths = [metrics.curves[difficulty].truths for metrics, difficulty, _ in report.rows()]
    if 0 in truths:
        notes.append(
            "Where there are no truths, 0 is what the protocol says, not what was measured."
        )
    if any(0 < count <= RECALL_STEPS for count in truths):
        notes.append(
            f"Of {RECALL_STEPS} truths and fewer, the protocol has fewer than {RECALL_STEPS + 1} "
            "thresholds, and finding all of them stays below 100 %."
        )
    return notes


def detection_results(report: DetectionReport) -> dict[str, Any]:
    """Return the figures for programs: by class, then by difficulty; null where nothing was detected."""
    results: dict[str, Any] = {
        metrics.of_class.name: {"iou": metrics.of_class.iou, "difficulties": None}
        for metrics in report.metrics.classes
    }
    for metrics, difficulty, samples in report.rows():
        of_class = results[metrics.of_class.name]
        of_class["difficulties"] = of_class["difficulties"] or {}
        of_class["difficulties"][difficulty] = _curve_results(report, metrics, difficulty, samples)
    return results


def _curve_results(
    report: DetectionReport,
    metrics: ClassMetrics,
    difficulty: str,
    samples: PrecisionSamples | None,
) -> dict[str, Any]:
    curve = metrics.curves[difficulty]
    results: dict[str, Any] = {}
    for points in report.recall_points:
        results[f"ap_r{points}_percent"] = curve.ap(points)
        results[f"aos_r{points}_percent"] = curve.aos(points)
        if samples is not None:
            results[f"ap_r{points}_interval_percent"] = samples.interval(points, CONFIDENCE)
    return {**results, **vars(curve)}


def detection_panels(report: DetectionReport) -> list[CurvePanel]:
    """Return what is drawn: one panel a class."""
    points = report.recall_points[-1]
    return [
        precision_panel(
            title=f"{metrics.of_class.name}, IoU over {metrics.of_class.iou:g}",
            curves={
                f"{name}: {curve.ap(points):.1f} % of {curve.truths}": curve.precision
                for name, curve in metrics.curves.items()
            },
            legend_title=f"average precision R{points}",
        )
        for metrics in report.metrics.classes
    ]
