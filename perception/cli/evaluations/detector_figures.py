"""The figures of `trifuse evaluate detector`, for people and for programs: each drive for itself."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from perception.cli.evaluations.class_precision import notes_on_few_objects, precision_header
from perception.cli.evaluations.detector_steps import MeasuredDetector
from perception.cli.table import Cell, format_table
from perception.render.curve_plots import CurvePanel


def detector_table(title: str, measured: Sequence[MeasuredDetector]) -> str:
    """Return a row for each drive, class, IoU and difficulty, and what one has to know."""
    all_classes = [precision for one in measured for precision in one.precision.values()]
    header = precision_header(all_classes[0], "data", "frames")
    rows: list[list[Cell]] = []
    for one in measured:
        data = one.detected.data
        for of_class, precision in one.precision.items():
            name = data.name if len(one.precision) == 1 else f"{data.name} {of_class.name}"
            rows += precision.rows(name, data.kind, data.frames_evaluated)
    notes = [*notes_on_few_objects(all_classes), *_times(measured)]
    return "\n".join([format_table(title, header, rows), *notes])


def detector_results(measured: Sequence[MeasuredDetector]) -> dict[str, Any]:
    """Return all figures by drive and class."""
    return {
        one.detected.data.name: {
            "data": one.detected.data.kind,
            "frames": one.detected.data.frames_evaluated,
            "ms_per_frame": {
                "median": np.median(one.ms_per_frame),
                "p99": np.percentile(one.ms_per_frame, 99),
            },
            "classes": {
                of_class.name: {"iou": precision.to_json()}
                for of_class, precision in one.precision.items()
            },
        }
        for one in measured
    }


def detector_panels(measured: Sequence[MeasuredDetector]) -> list[CurvePanel]:
    """Return what is drawn: one panel for each drive, class and IoU."""
    return [
        panel
        for one in measured
        for of_class, precision in one.precision.items()
        for panel in precision.panels(
            f"{one.detected.data.name} ({one.detected.data.kind}), {of_class.name}"
        )
    ]


def _times(measured: Sequence[MeasuredDetector]) -> Iterator[str]:
    for one in measured:
        yield (
            f"{one.detected.data.name}: {np.median(one.ms_per_frame):.1f} ms a frame in the median for picture "
            f"and network, 99 % below {np.percentile(one.ms_per_frame, 99):.1f}"
        )
