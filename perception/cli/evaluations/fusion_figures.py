"""The figures of `trifuse evaluate fusion`, for people and for programs: each drive for itself."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from perception.cli.evaluations.class_precision import ClassPrecision, interval_cell
from perception.cli.evaluations.detection_figures import CONFIDENCE
from perception.cli.evaluations.fusion_measure import Gain, MeasuredFusion
from perception.cli.evaluations.fusion_steps import MODALITY_NAMES, STEP_NAMES, VARIANT_NAMES
from perception.cli.table import Cell, format_table
from perception.evaluation.detection.precision_curve import max_ap
from perception.evaluation.detection.protocol import DIFFICULTIES
from perception.render.curve_plots import CurvePanel, precision_panel

# Table 7.10: easy, moderate, hard. Fig. 7.14 has 53.60 for the last; the text's gain of 1.05 points fits 55.10.
THESIS_PERCENT: Mapping[str, tuple[float, float, float]] = {
    MODALITY_NAMES["rgb"]: (73.93, 61.69, 54.00),
    MODALITY_NAMES["dm"]: (68.19, 54.59, 47.61),
    MODALITY_NAMES["rm"]: (68.36, 52.23, 45.22),
    VARIANT_NAMES["scores"]: (74.21, 62.18, 54.06),
    VARIANT_NAMES["features"]: (75.13, 62.74, 55.10),
}
_THESIS_IOU = 0.7
_LEVELS = tuple(one.name for one in DIFFICULTIES)
_NO_THESIS: list[Cell] = [None] * len(_LEVELS)
_PERFECT_DETECTOR = "all found, nothing else"
_STEPS_AT = "moderate"


def fusion_tables(measured: MeasuredFusion) -> str:
    """Return for each IoU the rows, what they gain, and what is left where a modality is lost; then notes."""
    iou_thresholds = next(iter(measured.rows.values())).reports
    tables = [
        table
        for iou in iou_thresholds
        for table in (_rows_table(measured, iou), _missing_modalities_table(measured, iou))
    ]
    return "\n\n".join([*tables, "\n".join(_notes(measured))])


def _rows_table(measured: MeasuredFusion, iou: float) -> str:
    rows: list[list[Cell]] = []
    for name, precision in measured.rows.items():
        rows.append([name, *_precision_cells(precision, iou), *_thesis_cells(name, iou)])
    rows.append([_PERFECT_DETECTOR, *_perfect_cells(measured), *_NO_THESIS])
    for name in _fused_names(measured):
        gains = [measured.gain(name, iou, level) for level in _LEVELS]
        rows.append([f"{name}, gain", *_gain_cells(gains), *_thesis_gains(name, iou)])
    data, recall_points = measured.data, next(iter(measured.rows.values())).recall_points
    title = (
        f"{data.name} ({data.kind}, {data.frames_evaluated} frames): AP R{recall_points} %, IoU over {iou:g}; "
        "gain over the best modality"
    )
    header = ["", *_level_columns(), *(f"thesis {level}" for level in _LEVELS)]
    return format_table(title, header, rows)


def _missing_modalities_table(measured: MeasuredFusion, iou: float) -> str:
    rows: list[list[Cell]] = []
    for remaining, precision in measured.missing_modalities.items():
        words = " + ".join(MODALITY_NAMES[name] for name in remaining)
        gains = [measured.remaining_gain(remaining, iou, level) for level in _LEVELS]
        rows += [
            [words, *_precision_cells(precision, iou)],
            [f"{words}, gain", *_gain_cells(gains)],
        ]
    title = (
        f"Modalities lost: our fusion of what is left, IoU over {iou:g}; gain over the best left"
    )
    return format_table(title, ["", *_level_columns()], rows)


def _level_columns() -> Iterator[str]:
    for level in _LEVELS:
        yield level
        yield f"{100 * CONFIDENCE:g} % interval"


def _precision_cells(precision: ClassPrecision, iou: float) -> Iterator[Cell]:
    for level in _LEVELS:
        ap = precision.ap(iou, level)
        yield None if np.isnan(ap) else f"{ap:.2f}"
        yield interval_cell(precision.interval(iou, level))


def _gain_cells(gains: Sequence[Gain]) -> Iterator[Cell]:
    for one in gains:
        yield None if np.isnan(one.points) else f"{one.points:+.2f}"
        yield interval_cell(one.interval)


def _fused_names(measured: MeasuredFusion) -> list[str]:
    return list(measured.rows)[len(measured.modalities) :]


def _perfect_cells(measured: MeasuredFusion) -> Iterator[Cell]:
    """Yield what finding all objects and nothing else comes to."""
    first = next(iter(measured.rows.values()))
    for level in _LEVELS:
        objects = first.objects[level]
        yield f"{max_ap(objects, first.recall_points):.2f}" if objects else None
        yield None


def _thesis_cells(name: str, iou: float) -> list[Cell]:
    if name not in THESIS_PERCENT or iou != _THESIS_IOU:
        return _NO_THESIS
    return [f"{percent:.2f}" for percent in THESIS_PERCENT[name]]


def _thesis_gains(name: str, iou: float) -> list[Cell]:
    if name not in THESIS_PERCENT or iou != _THESIS_IOU:
        return _NO_THESIS
    best = THESIS_PERCENT[MODALITY_NAMES["rgb"]]
    return [f"{own - single:+.2f}" for own, single in zip(THESIS_PERCENT[name], best, strict=True)]


def _notes(measured: MeasuredFusion) -> Iterator[str]:
    objects = next(iter(measured.rows.values())).objects
    yield "Objects: " + ", ".join(f"{objects[level]} {level}" for level in _LEVELS)
    yield "Expected calibration error, in points: " + ", ".join(
        f"{name} {100 * one.expected_calibration_error:.1f}"
        for name, one in measured.reliability.items()
    )
    yield (
        "The thesis' figures are of real frames that cannot be told which, over 11 recall points: beside "
        "these, not comparable with them."
    )


def fusion_results(measured: MeasuredFusion) -> dict[str, Any]:
    """Return all figures for programs."""
    iou_thresholds = next(iter(measured.rows.values())).reports
    return {
        "data": measured.data.kind,
        "frames": measured.data.frames_evaluated,
        "rows": {name: one.to_json() for name, one in measured.rows.items()},
        "gain_points": {
            name: {
                f"{iou:g}": {level: measured.gain(name, iou, level) for level in _LEVELS}
                for iou in iou_thresholds
            }
            for name in _fused_names(measured)
        },
        "left": {
            "+".join(remaining): {
                "iou": one.to_json(),
                "gain_points": {
                    f"{iou:g}": {
                        level: measured.remaining_gain(remaining, iou, level) for level in _LEVELS
                    }
                    for iou in iou_thresholds
                },
            }
            for remaining, one in measured.missing_modalities.items()
        },
        "steps": {name: one.to_json() for name, one in measured.steps.items()},
        "calibration": {
            name: {**vars(one), "expected_calibration_error": one.expected_calibration_error}
            for name, one in measured.reliability.items()
        },
        "thesis_table_7_10": THESIS_PERCENT,
    }


def fusion_panels(measured: MeasuredFusion) -> list[CurvePanel]:
    """Return the curves of every row, a panel a difficulty, and of the steps (Fig. 7.14)."""
    iou = next(iter(next(iter(measured.rows.values())).reports))
    panels = [_panel(f"{level}, IoU over {iou:g}", measured.rows, iou, level) for level in _LEVELS]
    steps = {name: measured.steps[name] for name in STEP_NAMES}
    return [*panels, _panel(f"steps of our fusion, {_STEPS_AT}", steps, iou, _STEPS_AT)]


def _panel(title: str, rows: Mapping[str, ClassPrecision], iou: float, level: str) -> CurvePanel:
    curves = {}
    for name, precision in rows.items():
        curve = precision.curve(iou, level)
        if curve is not None:
            curves[f"{name}: {precision.ap(iou, level):.1f} %"] = curve.precision
    return precision_panel(title, curves, "average precision")
