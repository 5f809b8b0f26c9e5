"""Average precision of one class on one drive, at several overlaps: measured, as cells, as panels, as JSON."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from data.kitti.detection_rows import DetectionSet
from perception.cli.evaluations.detection import (
    DETECTION_PROTOCOL,
    BootstrapConfig,
    measure_detections,
)
from perception.cli.evaluations.detection_figures import (
    CONFIDENCE,
    DetectionReport,
    detection_panels,
    detection_results,
)
from perception.cli.table import Cell, percent
from perception.evaluation.detection.bootstrap import Interval, percentile_interval
from perception.evaluation.detection.evaluation_boxes import count_objects
from perception.evaluation.detection.precision_curve import PrecisionCurve, RecallPoints, max_ap
from perception.evaluation.detection.protocol import DIFFICULTIES, RECALL_STEPS, DetectionClass
from perception.render.curve_plots import CurvePanel
from perception.types import Float64

PROTOCOL_WORDS = {
    **DETECTION_PROTOCOL,
    "truncation": (
        "of tracking labels, level 0 counts at every difficulty, levels 1 and 2 at none; the objects that "
        "are in both of KITTI's benchmarks bear this out: of level 0, 97 % are cut by 0.15 or less, of "
        "level 1, 99.6 % by more than 0.5, of level 2, half"
    ),
}


@dataclass(frozen=True)
class MetricConfig:
    """How detections are measured.

    Attributes:
        iou_thresholds: that a detection must exceed, one measure after the other.
        recall_points: over how many points precision is averaged.
        resampling: which gives intervals.
    """

    iou_thresholds: tuple[float, ...] = (0.7, 0.5)
    recall_points: RecallPoints = 40
    resampling: BootstrapConfig = field(default_factory=BootstrapConfig)


@dataclass(frozen=True)
class ClassPrecision:
    """What detections of one class are worth.

    Attributes:
        of_class: its name.
        objects: by difficulty, how many there are to be found.
        reports: by IoU, each of this class alone.
    """

    of_class: str
    objects: Mapping[str, int]
    reports: Mapping[float, DetectionReport]

    @classmethod
    def of(
        cls, found: DetectionSet, of_class: DetectionClass, config: MetricConfig
    ) -> "ClassPrecision":
        """Measure at every overlap."""
        frames = len(found.numbers)
        return cls(
            of_class.name,
            {one.name: count_objects(found.truths, frames, of_class, one) for one in DIFFICULTIES},
            {
                iou: measure_detections(
                    found, (of_class.at_iou(iou),), (config.recall_points,), config.resampling
                )
                for iou in config.iou_thresholds
            },
        )

    @property
    def recall_points(self) -> RecallPoints:
        """Over how many points precision is averaged."""
        return next(iter(self.reports.values())).recall_points[0]

    def curve(self, iou: float, difficulty: str) -> PrecisionCurve | None:
        """Return the curve, or None where nothing was detected."""
        return self.reports[iou].metrics.classes[0].curves.get(difficulty)

    def ap(self, iou: float, difficulty: str) -> float:
        """Return the average precision in percent, 0 where nothing was detected; NaN of no object."""
        if not self.objects[difficulty]:
            return float("nan")
        curve = self.curve(iou, difficulty)
        return curve.ap(self.recall_points) if curve else 0.0

    def samples(self, iou: float, difficulty: str) -> Float64:
        """Return (N,) averages over the choices of frames that were asked for; NaN without an object."""
        report = self.reports[iou]
        if not report.samples or difficulty not in report.samples[0]:
            return np.zeros(0)
        return report.samples[0][difficulty].percent[self.recall_points]

    def interval(self, iou: float, difficulty: str) -> Interval:
        """Return between which averages most choices of frames lie; NaN where that is not known."""
        return percentile_interval(self.samples(iou, difficulty), CONFIDENCE)

    def rows(self, name: str, *extra_cells: Cell) -> Iterator[list[Cell]]:
        """Yield one row for each overlap and difficulty, as `precision_header` names the columns."""
        for iou, report in self.reports.items():
            for difficulty in (one.name for one in DIFFICULTIES):
                objects, curve = self.objects[difficulty], self.curve(iou, difficulty)
                yield [
                    f"{name} {difficulty}",
                    *extra_cells,
                    f"{iou:g}",
                    objects,
                    percent(curve.matches, curve.truths) if curve else None,
                    f"{curve.ap(self.recall_points):.2f}" if curve and curve.truths else None,
                    *([interval_cell(self.interval(iou, difficulty))] if report.samples else []),
                    f"{max_ap(objects, self.recall_points):.1f}" if objects else None,
                ]

    def to_json(self) -> dict[str, Any]:
        """Return the figures for programs, by IoU and difficulty."""
        return {f"{iou:g}": self._at_iou(iou) for iou in self.reports}

    def panels(self, title: str) -> list[CurvePanel]:
        """Return the curves, a panel for each IoU."""
        return [
            replace(panel, title=f"{title}, IoU over {iou:g}")
            for iou, report in self.reports.items()
            for panel in detection_panels(report)
        ]

    def _at_iou(self, iou: float) -> dict[str, Any]:
        found = detection_results(self.reports[iou])[self.of_class]["difficulties"] or {}
        return {
            one.name: {
                "objects": self.objects[one.name],
                "max_ap_percent": max_ap(self.objects[one.name], self.recall_points),
                "detections": found.get(one.name),
            }
            for one in DIFFICULTIES
        }


def precision_header(measured: ClassPrecision, *extra_cells: str) -> list[str]:
    """Return the columns of `ClassPrecision.rows`."""
    has_intervals = any(report.samples for report in measured.reports.values())
    interval = [f"{100 * CONFIDENCE:g} % interval"] if has_intervals else []
    return [
        "",
        *extra_cells,
        "IoU",
        "objects",
        "found",
        f"AP R{measured.recall_points} %",
        *interval,
        "of at most",
    ]


def interval_cell(interval: Interval) -> str | None:
    """Return an interval as it stands in a table."""
    return None if np.isnan(interval.low) else f"{interval.low:.2f} to {interval.high:.2f}"


def notes_on_few_objects(measured: Sequence[ClassPrecision]) -> Iterator[str]:
    """Say, where there are few objects, what the protocol makes of them."""
    if min(objects for one in measured for objects in one.objects.values()) <= RECALL_STEPS:
        yield (
            f"Of {RECALL_STEPS} objects and fewer, the protocol has fewer than {RECALL_STEPS + 1} "
            "thresholds: finding all of them and nothing else comes to less than 100 %, to what is "
            "named as at most."
        )
