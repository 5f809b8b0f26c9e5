"""Figures of detectors that differ in one thing, as tables and curves."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.studies.detector_variants import VariantMetrics
from perception.cli.table import Cell, format_table
from perception.evaluation.detection.protocol import DIFFICULTIES
from perception.render.curve_plots import Curve, CurvePanel, plot_curves, precision_panel

Percent = tuple[float, float, float]  # easy, moderate, hard
LEVELS = tuple(one.name for one in DIFFICULTIES)
_SHOWN_LEVEL = "moderate"


def precision_tables(
    title: str,
    metrics: Mapping[str, VariantMetrics],
    iou: float,
    thesis: Mapping[str, Percent] | None = None,
) -> str:
    """Return a table for each drive: a row a variant, beside the thesis' figures where there are any."""
    known = thesis or {}
    header = ["", "data", "frames learned", "best epoch", *LEVELS]
    header += [f"thesis {level}" for level in LEVELS] if known else []
    return "\n\n".join(
        format_table(
            f"{title}: AP R40 % on {drive}, IoU over {iou:g}",
            header,
            [
                [
                    name,
                    one.drives[drive]["data"],
                    one.training_frames,
                    one.epoch,
                    *(_precision_cell(one, drive, iou, level) for level in LEVELS),
                    *(_thesis_cells(known, name) if known else ()),
                ]
                for name, one in metrics.items()
            ],
        )
        for drive in _drives(metrics)
    )


def times_table(
    title: str, metrics: Mapping[str, VariantMetrics], thesis_ms: tuple[float, float]
) -> str:
    """Return what pictures and networks take, beside what they took in the thesis."""
    rows: list[list[Cell]] = [
        [name, f"{one.maps_ms:.1f}", f"{one.network_ms:.1f}"] for name, one in metrics.items()
    ]
    rows.append(["thesis", *(f"{ms:g}" for ms in thesis_ms)])
    return format_table(title, ("", "map ms", "network ms"), rows)


def plot_variant_curves(
    plot_path: Path, title: str, metrics: Mapping[str, VariantMetrics], iou: float
) -> None:
    """Draw the precision-recall curves of all variants, a panel for each drive."""
    panels = []
    for drive in _drives(metrics):
        curves = {}
        for name, one in metrics.items():
            found = one.detections(drive, iou, _SHOWN_LEVEL)
            if found is not None:
                curves[f"{name}: {one.ap(drive, iou, _SHOWN_LEVEL):.1f} %"] = np.array(
                    found["curve"]["precision"]
                )
        panels.append(
            precision_panel(f"{drive}, {_SHOWN_LEVEL}, IoU over {iou:g}", curves, "AP R40")
        )
    plot_curves(plot_path, title, panels)


def plot_over_frames(
    plot_path: Path, title: str, metrics: Mapping[str, VariantMetrics], ious: Sequence[float]
) -> None:
    """Draw average precision over the number of frames that were learned from, a panel for each drive."""
    in_order = sorted(metrics.values(), key=lambda one: one.training_frames)
    frames = [one.training_frames for one in in_order]
    panels = [
        CurvePanel(
            f"{drive} ({in_order[0].drives[drive]['data']})",
            "training frames",
            "AP R40 [%]",
            [
                Curve(
                    f"{level}, IoU {iou:g}",
                    frames,
                    [one.ap(drive, iou, level) for one in in_order],
                )
                for iou in ious
                for level in LEVELS
            ],
            x_ticks=frames,
        )
        for drive in _drives(metrics)
    ]
    plot_curves(plot_path, title, panels, share_y="all")


def _drives(metrics: Mapping[str, VariantMetrics]) -> list[str]:
    return list(next(iter(metrics.values())).drives)


def _precision_cell(one: VariantMetrics, drive: str, iou: float, level: str) -> Cell:
    found = one.detections(drive, iou, level) or {}
    low, high = found.get("ap_r40_low_percent"), found.get("ap_r40_high_percent")
    words = f"{one.ap(drive, iou, level):.2f}"
    if low is None:
        return words
    return f"{words} ({low:.1f} to {high:.1f})"


def _thesis_cells(known: Mapping[str, Percent], name: str) -> list[Cell]:
    if name not in known:
        return [None] * len(LEVELS)
    return [f"{percent:.2f}" for percent in known[name]]
