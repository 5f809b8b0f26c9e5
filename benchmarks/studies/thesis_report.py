"""Tables 7.8, 7.9 and 7.10 and Figs 7.8 to 7.16 from the finished files of the experiments."""

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.studies.augmentation import THESIS_PERCENT as TABLE_7_8
from benchmarks.studies.report import formatted_table, publish
from data.detections.measured_detectors import run_depthcn
from data.splits.files import read_split
from perception.atomic_file import write_atomically, write_jpeg
from perception.detection.config import DepthCnConfig, DetectionConfig
from perception.detection.detectors.modalities import modality_image
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.networks import open_depthcn, open_detectors, open_fusion
from perception.evaluation.detection.fusion_measure import (
    MODALITY_NAMES,
    VARIANT_NAMES,
)
from perception.evaluation.detection.fusion_measure import THESIS_PERCENT as TABLE_7_10
from perception.evaluation.detection.protocol import LEVELS
from perception.evaluation.detection.published import PUBLISHED_PERCENT
from perception.evaluation.report import Table
from perception.render.curve_plots import CurvePanel, plot_curves, precision_panel
from perception.render.detection_composition import DetectionComposition, DetectionScene
from perception.render.detections import color_depth_map, draw_detection_errors
from perception.types import Detections, Drive, UInt8

_IOU = "0.7"
_AP = "ap_r11_percent"
_IMAGES = 4  # of Figs 7.10 and 7.16
_STEPS = {"merged": "merged", "rescored": "re-scored", "rescored and suppressed": "and suppressed"}
# The fusion that is measured first has this name, whatever its features are.
_MEASURED = VARIANT_NAMES["default"]
# Figures that trainings have drawn.
_DRAWN = {
    "figure-7.12.png": "scores/rescoring.png",
    "figure-7.13.png": "features/sizes.png",
}

# Precision by difficulty and what else is measured at one IoU.
ByLevel = Mapping[str, Mapping[str, Any]]


def report(out: Path, conditions: Mapping[str, object]) -> None:
    """Write and print the tables, and draw the figures, from the files of the experiments.

    Args:
        out: Folder of the experiments.
        conditions: Settings, which the tables state.
    """
    depthcn, fusion = _results(out / "depthcn.json"), _results(out / "fusion.json")
    fused = fusion["classes"]["Car"]
    rows = fusion_rows(fused)
    tables = {
        "Table 7.8": recognition_table(out),
        "Table 7.9": depthcn_table(depthcn["classes"]["Car"][_IOU]),
        "Table 7.10": fusion_table(rows),
    }
    text = "\n\n".join(table.text() for table in tables.values())
    write_atomically(out / "tables.txt", f"{text}\n".encode())
    draw_curves(out, depthcn["classes"]["Car"][_IOU], rows, fused["steps"])
    for figure, source in _DRAWN.items():
        shutil.copyfile(out / source, out / figure)
    draw_frames(out)
    publish(out / "tables.txt", "Tables 7.8, 7.9, 7.10", tables, conditions)


def recognition_table(out: Path) -> Table[Any]:
    """Return Table 7.8: accuracy of DepthCN's network without and with augmentation."""
    rows = {}
    for name, published in TABLE_7_8.items():
        parts = json.loads((out / name / "metrics.json").read_text())["parts"]
        accuracy = [100 * parts[part]["accuracy"] for part in ("training", "validation")]
        rows[f"{name} augmentation"] = (*accuracy, *published)
    specs = dict.fromkeys(("training", "validation", "thesis training", "thesis validation"), ".2f")
    return formatted_table("Table 7.8: accuracy [%]", "", specs, rows)


def depthcn_table(ours: ByLevel) -> Table[Any]:
    """Return Table 7.9: average precision of DepthCN."""
    rows = {
        "DepthCN, test frames of the split": tuple(ours[level][_AP] for level in LEVELS),
        **{
            f"published, KITTI's test frames: {name}": row
            for name, row in PUBLISHED_PERCENT["table-7.9"].items()
        },
    }
    title = "Table 7.9: AP R11 [%], IoU over 0.7"
    return formatted_table(title, "", dict.fromkeys(LEVELS, ".2f"), rows)


def fusion_table(rows: Mapping[str, ByLevel]) -> Table[Any]:
    """Return Table 7.10: average precision of each modality and of both fusions."""
    specs = {name: ".2f" for level in LEVELS for name in (level, f"thesis {level}")}
    values = {
        name: [
            value
            for place, level in enumerate(LEVELS)
            for value in (one[level][_AP], TABLE_7_10[name][place])
        ]
        for name, one in rows.items()
    }
    title = "Table 7.10: AP R11 [%] on test frames, IoU over 0.7"
    return formatted_table(title, "", specs, values)


def draw_curves(
    out: Path, depthcn: ByLevel, rows: Mapping[str, ByLevel], steps: Mapping[str, Any]
) -> None:
    """Draw precision over recall on the test frames, with the printed average precision in the legends.

    Args:
        out: Folder of the figures.
        depthcn: Metrics of DepthCN by difficulty.
        rows: Metrics of each row of Table 7.10 by difficulty.
        steps: Metrics of the boxes before rescoring, after it, and after suppression.
    """
    fused = rows[VARIANT_NAMES["features"]]
    printed = PUBLISHED_PERCENT["table-7.9"]["DepthCN"]
    plot_curves(out / "figure-7.9.png", "DepthCN", [_panel("", depthcn, printed)])
    plot_curves(
        out / "figure-7.11.png",
        "Modalities",
        [_panel(name, rows[name], TABLE_7_10[name]) for name in MODALITY_NAMES.values()],
    )
    by_step = {
        level: {_STEPS[name]: one[_IOU][level] for name, one in steps.items()} for level in LEVELS
    }
    plot_curves(
        out / "figure-7.14.png",
        "Fusion, step by step",
        [_panel(level, found) for level, found in by_step.items()],
    )
    printed = PUBLISHED_PERCENT["table-7.11"]["thesis"]
    plot_curves(out / "figure-7.15.png", "Fusion", [_panel("", fused, printed)])


def _panel(
    title: str, found: ByLevel, published: Sequence[float | None] = (None, None, None)
) -> CurvePanel:
    """Return the curves of a panel, each with its average precision and the printed one."""
    curves = {}
    for (name, one), printed in zip(found.items(), published, strict=True):
        if one["curve"] is None:
            continue
        note = f"{one[_AP]:.1f} %" + ("" if printed is None else f", thesis {printed:.1f} %")
        curves[f"{name}: {note}"] = np.array(one["curve"]["precision"])
    return precision_panel(title, curves, "average precision R11")


def draw_frames(out: Path) -> None:
    """Draw DepthCN's proposals and detections, and fused detections, in some test frames (Figs 7.10, 7.16)."""
    split = read_split(out / "split.json")
    drive = split.require_part(split.open(), "test")[0]
    config = DetectionConfig(
        rgb_model=out / "rgb.onnx",
        dm_model=out / "dm.onnx",
        rm_model=out / "rm.onnx",
        depthcn=DepthCnConfig(model=out / "depthcn.onnx"),
        fusion_model=out / "features/fusion.onnx",
    )
    for figure, images in (("7.10", _depthcn_images), ("7.16", _fused_images)):
        write_jpeg(out / f"figure-{figure}.jpg", _sheet(list(images(drive, config))))


def _depthcn_images(drive: Drive, config: DetectionConfig) -> Iterator[UInt8]:
    detector = open_depthcn(config, drive.sensor)
    for index in _indices(drive):
        frame = drive[index]
        output, dense = run_depthcn(detector, frame)
        assert output.proposals_px is not None  # DepthCN has proposals
        scene = DetectionScene(
            number=frame.number,
            image=frame.image,
            depth=color_depth_map(dense),
            proposals_px=output.proposals_px,
            detections=_displayed(output.detections, config),
            timings_s=output.timings_s,
        )
        yield DetectionComposition.of(scene, 1 / drive.sensor.rate_hz).draw(scene)


def _fused_images(drive: Drive, config: DetectionConfig) -> Iterator[UInt8]:
    detector = MultimodalDetector(open_detectors(config), open_fusion(config))
    for index in _indices(drive):
        frame, labels = drive[index], drive.labels(index)
        is_car = labels.types == "Car"
        yield draw_detection_errors(
            modality_image(frame, "dm" if frame.image is None else "rgb"),
            labels.boxes_px[is_car],
            labels.boxes_px[~is_car],
            _displayed(detector.detect(frame).fused.detections, config),
            float(_IOU),
        )


def _indices(drive: Drive) -> list[int]:
    return sorted(set(np.linspace(0, len(drive) - 1, _IMAGES).round().astype(int).tolist()))


def _displayed(detections: Detections, config: DetectionConfig) -> Detections:
    return detections[detections.scores >= config.display_score]


def _sheet(images: Sequence[UInt8]) -> UInt8:
    """Return images below one another, all as wide as the narrowest."""
    width = min(one.shape[1] for one in images)
    return np.concatenate([one[:, :width] for one in images])


def _results(file: Path) -> Any:  # noqa: ANN401 - JSON of `trifuse evaluate`
    """Return the metrics of the first drive of an evaluation."""
    return next(iter(json.loads(file.read_text())["results"].values()))


def fusion_rows(results: Mapping[str, Any]) -> dict[str, ByLevel]:
    """Return the rows of Table 7.10 in its order, at its IoU."""
    measured = {name: row[_IOU] for name, row in results["rows"].items()}
    measured[VARIANT_NAMES["features"]] = measured.pop(_MEASURED)
    return {name: measured[name] for name in TABLE_7_10}
