"""The figures of `trifuse evaluate depthcn`, for people and for programs: each drive for itself."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from perception.cli.evaluations.depthcn_steps import FoundCars
from perception.cli.evaluations.detection_figures import (
    CONFIDENCE,
    DetectionReport,
    detection_panels,
    detection_results,
)
from perception.cli.table import Cell, format_table, percent
from perception.detection.verifier import VEHICLE
from perception.evaluation.detection.curve import best_ap
from perception.evaluation.detection.proposal_recall import ProposalRecall
from perception.evaluation.detection.protocol import DIFFICULTIES, RECALL_STEPS
from perception.render.precision_plots import PrecisionPanel

# Table 7.9, on the test set of KITTI's server, over 11 recall points; 2.3 s a frame (7.2.1).
THESIS_EASY_PERCENT, THESIS_FRAMES = 37.59, 7518
_THESIS_IOU = 0.7


@dataclass(frozen=True)
class DriveFigures:
    """What the detector is worth on one drive.

    Attributes:
        found: what the figures are of.
        reports: by IoU, each of one class.
        recall: of the proposals, at the same IoUs.
    """

    found: FoundCars
    reports: Mapping[float, DetectionReport]
    recall: ProposalRecall

    @property
    def kind(self) -> str:
        """Whether the drive is real."""
        return "synthetic" if self.found.data.is_synthetic else "real"

    def rows(self) -> Iterator[list[Cell]]:
        """Yield one row for each IoU and difficulty."""
        for iou, report in self.reports.items():
            for difficulty in (one.name for one in DIFFICULTIES):
                reached = self.recall.difficulties[difficulty]
                curve = report.figures.classes[0].curves.get(difficulty)
                yield [
                    f"{self.found.data.name} {difficulty}",
                    self.kind,
                    self.recall.frames,
                    f"{iou:g}",
                    reached.objects,
                    percent(reached.found(iou), reached.objects),
                    percent(curve.matches, curve.truths) if curve else None,
                    f"{curve.ap(report.averaged[0]):.2f}" if curve and curve.truths else None,
                    *_interval(report, difficulty),
                    f"{best_ap(reached.objects, report.averaged[0]):.1f}"
                    if reached.objects
                    else None,
                ]

    def to_json(self) -> dict[str, Any]:
        """Return the same figures for programs."""
        ms = 1e3 * self.found.seconds
        return {
            "data": self.kind,
            "frames": self.recall.frames,
            "ms_a_frame": {"mean": ms.mean(), "p99": np.percentile(ms, 99)},
            "proposals_a_frame": self.recall.proposals_a_frame,
            "iou": {f"{iou:g}": self._at_iou(iou) for iou in self.reports},
        }

    def _at_iou(self, iou: float) -> dict[str, Any]:
        found = detection_results(self.reports[iou])[VEHICLE]["difficulties"] or {}
        return {
            one.name: {
                "objects": self.recall.difficulties[one.name].objects,
                "at_most_percent": best_ap(
                    self.recall.difficulties[one.name].objects, self.reports[iou].averaged[0]
                ),
                "proposals_reach": self.recall.difficulties[one.name].recall(iou),
                "detections": found.get(one.name),
            }
            for one in DIFFICULTIES
        }


def depthcn_table(measured: Sequence[DriveFigures]) -> str:
    """Return a row for each drive, IoU and difficulty, the thesis' row, and what one has to know."""
    report = next(iter(measured[0].reports.values()))
    points, has_intervals = report.averaged[0], bool(report.samples)
    header: list[str] = [
        *("", "data", "frames", "IoU", "objects", "proposals reach", "found", f"AP R{points} %"),
        *([f"{100 * CONFIDENCE:g} % interval"] if has_intervals else []),
        "of at most",
    ]
    rows: list[list[Cell]] = [row for one in measured for row in one.rows()]
    thesis: list[Cell] = [
        "thesis, Table 7.9 easy",
        "real",
        THESIS_FRAMES,
        f"{_THESIS_IOU:g}",
        None,
        None,
        None,
    ]
    rows.append([*thesis, f"{THESIS_EASY_PERCENT:.2f}", *([None] * has_intervals), "100.0"])
    table = format_table("DepthCN: cars, by KITTI's measure of boxes in the image", header, rows)
    return "\n".join([table, *_notes(measured)])


def _interval(report: DetectionReport, difficulty: str) -> list[Cell]:
    """Return the cell of the interval, or none where none was asked for."""
    if not report.samples:
        return []
    samples = report.samples[0].get(difficulty)
    if samples is None or np.isnan(samples.percent[report.averaged[0]]).all():
        return [None]
    interval = samples.interval(report.averaged[0], CONFIDENCE)
    return [f"{interval.low:.2f} to {interval.high:.2f}"]


def _notes(measured: Sequence[DriveFigures]) -> Iterator[str]:
    yield (
        "The thesis' figure is of the test set of KITTI's server, whose labels are not public, over 11 "
        "points: beside these, not comparable with them."
    )
    objects = [
        one.recall.difficulties[difficulty.name].objects
        for one in measured
        for difficulty in DIFFICULTIES
    ]
    if min(objects) <= RECALL_STEPS:
        yield (
            f"Of {RECALL_STEPS} objects and fewer, the protocol has fewer than {RECALL_STEPS + 1} "
            "thresholds: finding all of them and nothing else comes to less than 100 %, to what is "
            "named as at most."
        )
    for one in measured:
        ms = 1e3 * one.found.seconds
        yield (
            f"{one.found.data.name}: {ms.mean():.1f} ms a frame on average, 99 % below "
            f"{np.percentile(ms, 99):.1f}; {one.recall.proposals_a_frame:.1f} proposals a frame"
        )


def depthcn_results(measured: Sequence[DriveFigures]) -> dict[str, Any]:
    """Return all figures by drive, and the thesis'."""
    thesis = {"ap_r11_percent": {"easy": THESIS_EASY_PERCENT}, "frames": THESIS_FRAMES}
    return {
        "drives": {one.found.data.name: one.to_json() for one in measured},
        "thesis_table_7_9": {**thesis, "data": "test set of KITTI's server"},
    }


def depthcn_panels(measured: Sequence[DriveFigures]) -> list[PrecisionPanel]:
    """Return what is drawn: one panel for each drive and IoU."""
    return [
        replace(panel, title=f"{one.found.data.name} ({one.kind}), IoU over {iou:g}")
        for one in measured
        for iou, report in one.reports.items()
        for panel in detection_panels(report)
    ]
