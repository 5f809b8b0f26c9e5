"""`trifuse evaluate robustness`: average precision while the camera or the LiDAR sees ever less."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from perception.cli.evaluations.class_precision import PROTOCOL_WORDS, ClassPrecision
from perception.cli.evaluations.document import Evaluation, write_evaluation
from perception.cli.evaluations.fusion_steps import FusionFiles
from perception.cli.evaluations.labelled_drives import (
    DriveSource,
    LabelledDrive,
    detect_drive,
    open_labelled,
)
from perception.cli.evaluations.measure_flags import DetectionEvaluationConfig
from perception.cli.evaluations.robustness_steps import (
    CLEAN,
    CorruptedDetector,
    Corruption,
    CorruptionLevels,
    robustness_rows,
)
from perception.cli.table import Cell, format_table
from perception.evaluation.detection.protocol import DIFFICULTIES, kitti_class
from perception.render.curve_plots import Curve, CurvePanel, plot_curves

_PLOT_DIFFICULTY = "moderate"
_OWN_WORDS = {
    "darkness": (
        "half the light a stop, without any gain to make up for it, and the noise of so few electrons: "
        "10,000 are white, reading adds 5"
    ),
    "rays": "returns are lost one by one, each as likely",
    "calibration": (
        "the scan is projected by a calibration that is turned about any axis through the camera, or "
        "shifted in any direction of the image; labels stay"
    ),
}

# By disturbance and level, what each row is worth.
Measured = Mapping[tuple[str, float], Mapping[str, ClassPrecision]]


def robustness(  # noqa: PLR0913 - flags of a command
    drive: Path,
    *,
    models: FusionFiles | None = None,
    levels: CorruptionLevels | None = None,
    class_name: str = "Car",
    iou: float = 0.7,
    plot: Path | None = None,
    json: Path | None = None,
    **flags: Any,  # noqa: ANN401 - fields of DetectionEvaluationConfig
) -> None:
    """Measure detectors and fusion over darkness, lost rays, and errors of the calibration.

    Example: trifuse evaluate robustness synth/test --plot robustness.png --levels.darkness "[2,4,6]"

    Args:
        drive: object folder, tracking sequence or synthetic drive.
        models: networks in the place of those that ship; --models.rgb FILE.onnx for one of them.
        levels: of each disturbance; --levels.pixels "[4,8]" for one of them, "[]" leaves it out.
        class_name: what is looked for.
        iou: overlap that a detection must exceed.
        plot: gets the curves as PNG.
        json: gets the same figures with protocol, data and configuration.
        flags: as DetectionEvaluationConfig says.
    """
    evaluation_config = DetectionEvaluationConfig(iou=iou, **flags)
    reading, measuring = evaluation_config.reading, evaluation_config.measuring
    chosen, files = levels or CorruptionLevels(), models or FusionFiles()
    name = " ".join(filter(None, (str(drive), reading.sequence)))
    source = DriveSource(name, drive, reading.sequence)
    opened = open_labelled(source, reading)
    corruptions = chosen.corruptions(has_images=opened.has_images)
    clean = files.open_detectors()
    fusion = files.open_fusions(clean)["default"]
    detector = CorruptedDetector(clean, corruptions, evaluation_config.seed)
    detected = detect_drive(source.name, opened, detector.detect, reading)
    of_class = kitti_class(class_name)
    measured = {
        key: {
            name: ClassPrecision.of(detected.with_labels(found), of_class, measuring)
            for name, found in robustness_rows(detected, key, fusion)
        }
        for key in detected.outputs[0]
    }
    print(robustness_tables(detected.data, corruptions, measured))
    if plot is not None:
        title = f"{detected.data.name} ({detected.data.kind}, {detected.data.frames_evaluated} frames), {class_name}"
        value_name = f"AP R{measuring.recall_points} %, {_PLOT_DIFFICULTY}, IoU over {iou:g}"
        panels = [_panel(one, measured, iou, value_name) for one in corruptions]
        plot_curves(plot, title, panels, columns=len(panels), share_y="all")
    if json is not None:
        values = {
            "difficulties": DIFFICULTIES,
            "levels": chosen,
            "seed": evaluation_config.seed,
            **asdict(measuring),
        }
        words = {**PROTOCOL_WORDS, **_OWN_WORDS, "values": values}
        metrics = Evaluation("robustness", words, robustness_results(corruptions, measured))
        write_evaluation(json, detected.data, {"models": files}, metrics)


def robustness_tables(
    data: LabelledDrive, corruptions: Sequence[Corruption], measured: Measured
) -> str:
    """Return a table for each disturbance: a row a level, a column for each detector and fusion."""
    tables = []
    for one in corruptions:
        rows: list[list[Cell]] = []
        for level, of_level in _of_levels(one, measured):
            shown = [_plotted_ap(precision) for precision in of_level.values()]
            rows.append([f"{level:g}", *(None if np.isnan(ap) else f"{ap:.2f}" for ap in shown)])
        title = f"{data.name} ({data.kind}, {data.frames_evaluated} frames): {one.name}, AP % {_PLOT_DIFFICULTY}"
        tables.append(format_table(title, ["", *measured[CLEAN]], rows))
    return "\n\n".join(tables)


def robustness_results(corruptions: Sequence[Corruption], measured: Measured) -> dict[str, Any]:
    """Return all figures by disturbance, level and row, at every difficulty."""
    return {
        one.name: {
            f"{level:g}": {name: precision.to_json() for name, precision in of_level.items()}
            for level, of_level in _of_levels(one, measured)
        }
        for one in corruptions
    }


def _of_levels(
    one: Corruption, measured: Measured
) -> list[tuple[float, Mapping[str, ClassPrecision]]]:
    """Return what rows are worth at each level, 0 the first."""
    corrupted = [(level, measured[one.name, level]) for level in one.levels]
    return [(0.0, measured[CLEAN]), *corrupted]


def _panel(one: Corruption, measured: Measured, iou: float, value_name: str) -> CurvePanel:
    of_levels = _of_levels(one, measured)
    levels, last = [level for level, _ in of_levels], list(measured[CLEAN])[-1]
    curves = [
        Curve(
            name,
            levels,
            [of_level[name].ap(iou, _PLOT_DIFFICULTY) for _, of_level in of_levels],
            is_emphasised=name == last,
        )
        for name in measured[CLEAN]
    ]
    return CurvePanel("", one.name, value_name, curves, x_ticks=levels)


def _plotted_ap(precision: ClassPrecision) -> float:
    return precision.ap(next(iter(precision.reports)), _PLOT_DIFFICULTY)
