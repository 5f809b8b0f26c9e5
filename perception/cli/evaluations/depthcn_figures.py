"""The figures of `trifuse evaluate depthcn`, for people and for programs: each drive for itself."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from perception.cli.evaluations.class_precision import (
    ClassPrecision,
    notes_on_few_objects,
    precision_header,
)
from perception.cli.evaluations.depthcn_steps import DetectedCars
from perception.cli.table import Cell, format_table, percent
from perception.evaluation.detection.proposal_recall import ProposalRecall
from perception.evaluation.detection.protocol import DIFFICULTIES
from perception.render.curve_plots import CurvePanel

# Table 7.9, on the test set of KITTI's server, over 11 recall points; 2.3 s a frame (7.2.1).
THESIS_EASY_PERCENT, THESIS_FRAMES = 37.59, 7518
_THESIS_IOU = 0.7
_RECALL_COLUMN = 5  # the column of what proposals reach, behind that of the objects


@dataclass(frozen=True)
class DepthCnMetrics:
    """What the detector is worth on one drive.

    Attributes:
        found: what the figures are of.
        precision: of the detections.
        recall: of the proposals, at the same IoUs.
    """

    found: DetectedCars
    precision: ClassPrecision
    recall: ProposalRecall

    def rows(self) -> Iterator[list[Cell]]:
        """Yield one row for each IoU and difficulty."""
        data = self.found.data
        rows = self.precision.rows(data.name, data.kind, self.recall.frames)
        for row, reached in zip(rows, self._recall_cells(), strict=True):
            yield [*row[:_RECALL_COLUMN], reached, *row[_RECALL_COLUMN:]]

    def to_json(self) -> dict[str, Any]:
        """Return the same figures for programs."""
        ms = 1e3 * self.found.seconds
        at_ious = self.precision.to_json()
        for iou in self.precision.reports:
            for difficulty, metrics in at_ious[f"{iou:g}"].items():
                metrics["proposal_recall"] = self.recall.difficulties[difficulty].recall(iou)
        return {
            "data": self.found.data.kind,
            "frames": self.recall.frames,
            "ms_per_frame": {"mean": ms.mean(), "p99": np.percentile(ms, 99)},
            "proposals_per_frame": self.recall.proposals_per_frame,
            "iou": at_ious,
        }

    def _recall_cells(self) -> Iterator[str | None]:
        for iou in self.precision.reports:
            for difficulty in (one.name for one in DIFFICULTIES):
                reached = self.recall.difficulties[difficulty]
                yield percent(reached.found(iou), reached.objects)


def depthcn_table(measured: Sequence[DepthCnMetrics]) -> str:
    """Return a row for each drive, IoU and difficulty, the thesis' row, and what one has to know."""
    header = precision_header(measured[0].precision, "data", "frames")
    header.insert(_RECALL_COLUMN, "proposals reach")
    rows: list[list[Cell]] = [row for one in measured for row in one.rows()]
    thesis: dict[str, Cell] = {
        "": "thesis, Table 7.9 easy",
        "data": "real",
        "frames": THESIS_FRAMES,
        "IoU": f"{_THESIS_IOU:g}",
        f"AP R{measured[0].precision.recall_points} %": f"{THESIS_EASY_PERCENT:.2f}",
        "of at most": "100.0",
    }
    rows.append([thesis.get(column) for column in header])
    table = format_table("DepthCN: cars, by KITTI's measure of boxes in the image", header, rows)
    return "\n".join([table, *_notes(measured)])


def _notes(measured: Sequence[DepthCnMetrics]) -> Iterator[str]:
    yield (
        "The thesis' figure is of the test set of KITTI's server, whose labels are not public, over 11 "
        "points: beside these, not comparable with them."
    )
    yield from notes_on_few_objects([one.precision for one in measured])
    for one in measured:
        ms = 1e3 * one.found.seconds
        yield (
            f"{one.found.data.name}: {ms.mean():.1f} ms a frame on average, 99 % below "
            f"{np.percentile(ms, 99):.1f}; {one.recall.proposals_per_frame:.1f} proposals a frame"
        )


def depthcn_results(measured: Sequence[DepthCnMetrics]) -> dict[str, Any]:
    """Return all figures by drive, and the thesis'."""
    thesis = {"ap_r11_percent": {"easy": THESIS_EASY_PERCENT}, "frames": THESIS_FRAMES}
    return {
        "drives": {one.found.data.name: one.to_json() for one in measured},
        "thesis_table_7_9": {**thesis, "data": "test set of KITTI's server"},
    }


def depthcn_panels(measured: Sequence[DepthCnMetrics]) -> list[CurvePanel]:
    """Return what is drawn: one panel for each drive and IoU."""
    return [
        panel
        for one in measured
        for panel in one.precision.panels(f"{one.found.data.name} ({one.found.data.kind})")
    ]
