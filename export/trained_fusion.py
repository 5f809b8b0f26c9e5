"""What follows a training of the fusion: a calibrated model file, its precision on held-out frames, and figures (6.2.4)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
from lightning.pytorch import Trainer

from data.detections.detected_frames import DetectedFrames
from data.detections.fused_frames import (
    boxes_by_detector,
    class_correctness,
    curves_by_detector,
    fuse_frames,
)
from export.fusion import export_fusion
from export.result import ExportConfig
from perception.atomic_file import write_atomically
from perception.detection.fusion.rescoring import Fusion
from perception.detection.fusion.score_calibration import BetaCalibration, FusionCalibration
from perception.evaluation.detection.class_precision import level_columns
from perception.evaluation.detection.protocol import kitti_class
from perception.evaluation.detection.reliability import Reliability, measure_reliability
from perception.evaluation.report import Table
from perception.render.figure import save_figure
from train.checkpoint_writer import write_checkpoint
from train.checkpoints import read_checkpoint
from train.cli import Stage, TrainingKind
from train.events import tensorboard_loggers
from train.fusion.calibration import fit_calibration, fit_class_calibrations
from train.fusion.config import MODEL
from train.fusion.datamodule import FusionDataModule, row_tensors
from train.fusion.gauss_newton import mean_square
from train.fusion.network import load_fusion
from train.fusion.plots import fusion_figures
from train.fusion.sweep import SweptSize, choose_size, swept_sizes
from train.fusion.training import FusionTraining

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_EVALUATED: Mapping[Stage, str] = {"fit": "test", "validate": "validation", "test": "test"}


@dataclass(frozen=True)
class FusionResult:
    """Metrics of a checkpoint.

    Attributes:
        checkpoint: Checkpoint.
        file: Model file; None where the checkpoint was only evaluated.
        metadata: Metadata of the model file.
        epoch: Number of the checkpoint's epoch, from 1.
        part: Part of the frames that precision and reliability are of.
        counts: Number of frames and of combinations, by part.
        mean_square_error: Mean square error of the predictions, by part.
        ap_percent: Average precision at KITTI's IoU by class and detector, and by difficulty.
        expected_calibration_error: Expected calibration error of the scores of each detector.
        reliability: Reliability of the scores of each detector.
        swept: Errors of the sizes that were tried.
    """

    checkpoint: Path
    file: Path | None
    metadata: Mapping[str, str]
    epoch: int
    part: str
    counts: Mapping[str, int]
    mean_square_error: Mapping[str, float]
    ap_percent: Mapping[str, Mapping[str, float]]
    expected_calibration_error: Mapping[str, float]
    reliability: Mapping[str, Reliability]
    swept: Sequence[SweptSize] = ()

    @property
    def table(self) -> Table[Mapping[str, float]]:
        """Table of the average precision."""
        variant, hidden = self.metadata["variant"], self.metadata["hidden"]
        *_, error = self.mean_square_error.values()  # of the part that is not fitted
        neurons = f"{hidden} neurons, " if hidden else ""
        title = (
            f"Fusion, {variant}, {neurons}mean square error {error:.4f}: "
            f"AP [%] on {self.counts[f'{self.part}_frames']} {self.part} frames"
        )
        return Table(title, level_columns(), self.ap_percent, "class, min IoU, detector")


def report(
    module: FusionTraining, data: FusionDataModule, stage: Stage, checkpoint: Path
) -> FusionResult:
    """Export, calibrate, draw and measure the best epoch of a training; of an evaluation, measure alone.

    Args:
        module: Module of the training or of the evaluation.
        data: Its data.
        stage: Subcommand.
        checkpoint: Checkpoint of the best epoch, or the one that was evaluated.
    """
    file, parts, measured = None, [_EVALUATED[stage]], _EVALUATED[stage]
    if stage == "fit":
        if module.variant == "default":  # the thesis' scores are not calibrated
            _calibrate(checkpoint, data)
        file, parts = checkpoint.parent / "fusion.onnx", ["training", "validation"]
    fusion = _exported(checkpoint, file)
    frames: DetectedFrames = getattr(data.detections, measured)
    network, fused = load_fusion(checkpoint)[0], fuse_frames(frames.scenes, fusion)
    reliability = {
        name: measure_reliability(class_correctness(frames, found, data.detections.class_names))
        for name, found in boxes_by_detector(frames, fused).items()
    }
    swept: list[SweptSize] = []
    if stage == "fit":
        swept = swept_sizes(checkpoint.parent, module.sweep.sizes)
        figures = fusion_figures(frames, fusion, fused, reliability, swept)
        _write_figures(figures, checkpoint.parent, module.trainer)
    return FusionResult(
        checkpoint,
        file,
        fusion.metadata,
        epoch=read_checkpoint(checkpoint, MODEL)["epoch"] + 1,
        part=measured,
        counts={f"{measured}_frames": len(frames)} | _counts(data, parts),
        mean_square_error={
            part: float(mean_square(network, row_tensors(getattr(data, part)))) for part in parts
        },
        ap_percent={
            f"{one.name} {one.iou:g} {name}": {level: curve.ap() for level, curve in found.items()}
            for one in map(kitti_class, data.detections.class_names)
            for name, found in curves_by_detector(frames, fused, one).items()
        },
        expected_calibration_error={
            name: one.expected_calibration_error for name, one in reliability.items()
        },
        reliability=reliability,
        swept=swept,
    )


def _calibrate(checkpoint: Path, data: FusionDataModule) -> None:
    """Fit the curves from scores to probabilities to the validation frames; write them into the checkpoint."""
    frames, class_names = data.detections.validation, data.detections.class_names
    content = read_checkpoint(checkpoint, MODEL) | {"calibration": str(FusionCalibration())}
    write_checkpoint(checkpoint, content)
    fusion, named = _exported(checkpoint), dict[str, BetaCalibration]()
    for remaining in frames.remaining():
        fused = fuse_frames(remaining.scenes, fusion)
        of_classes = fit_class_calibrations(
            {name: class_correctness(remaining, fused.boxes, [name]) for name in class_names}
        )
        of_set = "+".join(remaining.modalities)
        named |= {f"{of_set}:{name}": curve for name, curve in of_classes.items()}
    for modality in frames.modalities:
        boxes = frames.of_modality(modality)
        # A detector without a box in these frames keeps its scores.
        if detected := np.unique(boxes.types).tolist():
            named[modality] = fit_calibration(class_correctness(frames, boxes, detected))
    calibration = str(FusionCalibration(named=named))
    write_checkpoint(checkpoint, content | {"calibration": calibration})


def _exported(checkpoint: Path, file: Path | None = None) -> Fusion:
    """Return the fusion of a checkpoint, and write its model file if a path is given."""
    exported = export_fusion(ExportConfig(checkpoint))
    exported.require_parity(checkpoint.name)
    with TemporaryDirectory() as folder:
        opened = file or Path(folder, "fusion.onnx")
        write_atomically(opened, exported.models["fp32"])
        return Fusion(opened)


def _write_figures(figures: "Mapping[str, Figure]", out: Path, trainer: Trainer) -> None:
    """Write figures as PNG, and into TensorBoard."""
    loggers = tensorboard_loggers(trainer)
    for name, figure in figures.items():
        save_figure(figure, out / f"{name}.png")
        for logger in loggers:
            logger.experiment.add_figure(f"test/{name}", figure, trainer.global_step)
    for logger in loggers:
        logger.experiment.close()


def _counts(data: FusionDataModule, parts: Sequence[str]) -> dict[str, int]:
    frames = {f"{part}_frames": len(getattr(data.detections, part)) for part in parts}
    return frames | {f"{part}_combinations": len(getattr(data, part)) for part in parts}


FUSION = TrainingKind(
    "fusion",
    FusionTraining,
    FusionDataModule,
    report,
    # Levenberg-Marquardt needs doubles, and so small a network is no slower by them.
    defaults={
        "trainer.max_epochs": 10,
        "trainer.precision": "64-true",
        "trainer.accelerator": "cpu",
    },
    links={"variant": "variant", "max_partners": "max_partners"},
    before_fit=choose_size,
)
