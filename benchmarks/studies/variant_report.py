"""Tables and curves of detectors that differ in one setting."""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.studies.detector_variants import VariantMetrics
from benchmarks.studies.report import formatted_table
from perception.evaluation.detection.protocol import LEVELS
from perception.evaluation.report import Column, Table
from perception.render.curve_plots import Curve, CurvePanel, plot_curves, precision_panel

Percent = tuple[float, float, float]  # easy, moderate, hard
_DISPLAY_LEVEL = "moderate"


def precision_tables(
    title: str,
    metrics: Mapping[str, VariantMetrics],
    ious: Sequence[float],
    thesis: Mapping[str, Percent] | None = None,
) -> dict[str, Table[str]]:
    """Return a table for each IoU and drive with a row for each variant, beside the thesis' values where there are any."""
    tables = {}
    for iou, drive in product(ious, _drives(metrics)):
        data = {name: one.drives[drive]["data"] for name, one in metrics.items()}
        columns: list[Column[str]] = [
            Column("data", data.get),
            Column("training frames", lambda name: metrics[name].training_frames, key="frames"),
            Column("best epoch", lambda name: metrics[name].epoch, key="epoch"),
        ]
        for place, level in enumerate(LEVELS):
            of = drive, iou, level
            columns.append(Column(level, partial(precision_of, metrics, of), ".2f", level))
            if any(_interval(metrics, of, name) for name in metrics):
                columns.append(Column("95 %", partial(_interval, metrics, of)))
            if thesis is not None:
                columns.append(Column("thesis", partial(_published, thesis, place), ".2f"))
        heading = f"{title}: AP R40 [%] on {drive}, IoU over {iou:g}"
        tables[heading] = Table(heading, columns, {name: name for name in metrics})
    return tables


def times_table(
    title: str, metrics: Mapping[str, VariantMetrics], thesis_ms: tuple[float, float]
) -> Table[Any]:
    """Return the times of maps and networks, and those of the thesis."""
    rows = {name: (one.maps_ms, one.network_ms) for name, one in metrics.items()}
    specs = {"map [ms]": ".1f", "network [ms]": ".1f"}
    return formatted_table(title, "", specs, {**rows, "thesis": thesis_ms})


def plot_variant_curves(
    plot_path: Path, title: str, metrics: Mapping[str, VariantMetrics], iou: float
) -> None:
    """Draw the precision-recall curves of all variants, a panel for each drive."""
    plot_curves(plot_path, title, variant_panels(metrics, iou))


def variant_panels(metrics: Mapping[str, VariantMetrics], iou: float) -> list[CurvePanel]:
    """Return the precision-recall curves of all variants, a panel for each drive."""
    panels = []
    for drive in _drives(metrics):
        curves = {
            f"{name}: {one.ap(drive, iou, _DISPLAY_LEVEL):.1f} %": np.array(
                found["curve"]["precision"]
            )
            for name, one in metrics.items()
            if (found := one.detections(drive, iou, _DISPLAY_LEVEL)) is not None
        }
        panels.append(
            precision_panel(f"{drive}, {_DISPLAY_LEVEL}, IoU over {iou:g}", curves, "AP R40")
        )
    return panels


def frames_panels(metrics: Mapping[str, VariantMetrics], ious: Sequence[float]) -> list[CurvePanel]:
    """Return average precision over the number of training frames, a panel for each drive."""
    in_order = sorted(metrics.values(), key=lambda one: one.training_frames)
    frames = [one.training_frames for one in in_order]
    return [
        CurvePanel(
            f"{drive} ({in_order[0].drives[drive]['data']})",
            "training frames",
            "AP R40 [%]",
            [
                Curve(
                    f"{level}, IoU {iou:g}", frames, [one.ap(drive, iou, level) for one in in_order]
                )
                for iou in ious
                for level in LEVELS
            ],
            x_ticks=frames,
        )
        for drive in _drives(metrics)
    ]


def _drives(metrics: Mapping[str, VariantMetrics]) -> list[str]:
    return list(next(iter(metrics.values())).drives)


def precision_of(
    metrics: Mapping[str, VariantMetrics], of: tuple[str, float, str], name: str
) -> float:
    """Return the average precision of a variant on a drive, at an IoU and a difficulty."""
    return metrics[name].ap(*of)


def _interval(
    metrics: Mapping[str, VariantMetrics], of: tuple[str, float, str], name: str
) -> str | None:
    found = metrics[name].detections(*of) or {}
    low, high = found.get("ap_r40_low_percent"), found.get("ap_r40_high_percent")
    return None if low is None else f"{low:.1f} to {high:.1f}"


def _published(thesis: Mapping[str, Percent], place: int, name: str) -> float | None:
    return thesis[name][place] if name in thesis else None
