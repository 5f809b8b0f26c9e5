"""Training of the fusion from cached detections to a calibrated model file (6.2.4)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from data.detections.fused_frames import (
    boxes_by_detector,
    class_correctness,
    curves_by_detector,
    fuse_frames,
)
from data.detections.split_detections import SplitDetections, split_detections
from export.fusion import export_fusion, with_calibrations
from export.result import ExportConfig
from perception.atomic_file import write_atomically
from perception.detection.fusion.rescoring import Fusion
from perception.detection.fusion.score_calibration import FusionCalibration
from perception.evaluation.detection.reliability import Reliability
from perception.types import MODALITIES, Progress
from train.checkpoints import program_revision, read_checkpoint
from train.config import TrainingRun
from train.fusion.calibration import fit_calibration
from train.fusion.config import MODEL, FusionExperiment
from train.fusion.plots import (
    plot_fusion_reliability,
    plot_fusion_rescoring,
    plot_fusion_sizes,
    plot_fusion_steps,
)
from train.fusion.previous import TrainingFolder
from train.fusion.sweep import SweptSize, hidden_sizes, sweep
from train.fusion.targets import FusionSets, fusion_rows
from train.fusion.training import FittedFusion, fit_fusion, write_calibrations

_SCORE_JITTERS = 2  # jittered copies of every frame, for the default variant


@dataclass(frozen=True)
class TrainedFusion:
    """Result of a training.

    Attributes:
        file: Model file.
        metadata: Metadata of the model file.
        fitted: Errors of the fit.
        swept: Errors of the sizes that were tried.
        counts: Frames and combinations of training, validation and test.
        test_ap_percent: Average precision on the test frames, by detector and difficulty.
        expected_calibration_error: Expected calibration error of the scores of each detector.
        reliability: Reliability of the scores of each detector.
    """

    file: Path
    metadata: Mapping[str, str]
    fitted: FittedFusion
    swept: tuple[SweptSize, ...]
    counts: Mapping[str, int]
    test_ap_percent: Mapping[str, Mapping[str, float]]
    expected_calibration_error: Mapping[str, float]
    reliability: Mapping[str, Reliability]


def run_experiment(
    experiment: FusionExperiment,
    run: TrainingRun,
    folder: TrainingFolder,
    progress: Progress = iter,
) -> TrainedFusion:
    """Train the fusion in a folder, and plot and measure it on the test frames.

    Args:
        experiment: All settings of the fusion.
        run: Epochs and seed.
        folder: Folder of the training.
        progress: Wrapper of the loop over frames that may show its progress.

    Raises:
        UsageError: a detector was trained on one of the drives.
        PerceptionError: drives, models or a checkpoint cannot be used.
    """
    if folder.resume is not None:
        read_checkpoint(folder.resume, MODEL)  # detecting takes long
    detections = split_detections(
        experiment.drives, experiment.models, experiment.data, run.seed, progress
    )
    sets = FusionSets(
        fusion_rows(detections.training, experiment.training.variant, score_jitters=_SCORE_JITTERS),
        fusion_rows(detections.validation, experiment.training.variant),
    )
    config = replace(
        experiment.training,
        seed=run.seed,
        training_data=experiment.drives.names,
        detectors=detections.detectors,
        class_names=detections.class_names,
        revision=program_revision(),
    )
    sizes = hidden_sizes(experiment.sweep, experiment.sweep_two)
    swept = tuple(sweep(sets, config, sizes))
    if swept:
        best = min(swept, key=lambda one: one.validation)
        config = replace(config, hidden=best.hidden)
    fitted, out = fit_fusion(sets, config, run, folder), folder.out
    file, metadata = out / "fusion.onnx", _export(fitted.checkpoint, out / "fusion.onnx")
    if experiment.training.variant == "default":  # the thesis' scores are not calibrated
        metadata = metadata | {"calibration": _calibrate(file, fitted.checkpoint, detections)}
    counts = {
        "training_frames": len(detections.training),
        "training_combinations": len(sets.training),
        "validation_frames": len(detections.validation),
        "validation_combinations": len(sets.validation),
        "test_frames": len(detections.test),
    }
    frames, network = detections.test, Fusion(file)
    fused = fuse_frames(frames.scenes, network)
    plot_fusion_rescoring(out / "rescoring.png", frames, network)
    plot_fusion_steps(out / "steps.png", frames, fused)
    reliability = plot_fusion_reliability(
        out / "reliability.png", frames, fused, detections.class_names
    )
    if swept:
        plot_fusion_sizes(out / "sizes.png", swept)
    return TrainedFusion(
        file,
        metadata,
        fitted,
        swept,
        counts,
        test_ap_percent={
            name: {difficulty: curve.ap() for difficulty, curve in found.items()}
            for name, found in curves_by_detector(frames, fused).items()
        },
        expected_calibration_error={
            name: one.expected_calibration_error for name, one in reliability.items()
        },
        reliability=reliability,
    )


def _export(checkpoint: Path, file: Path) -> dict[str, str]:
    """Write the model file of a checkpoint; return its metadata."""
    exported = export_fusion(ExportConfig(checkpoint))
    exported.require_parity(file.name)
    write_atomically(file, exported.models["fp32"])
    return exported.metadata


def _calibrate(file: Path, checkpoint: Path, detections: SplitDetections) -> str:
    """Write the curves from scores to probabilities into a model file and its checkpoint; return them."""
    frames = detections.validation
    boxes = boxes_by_detector(frames, fuse_frames(frames.scenes, Fusion(file)))
    curves = {
        name: fit_calibration(class_correctness(frames, found, detections.class_names))
        for name, found in boxes.items()
    }
    calibrations = FusionCalibration(
        joint=curves["fusion"], alone={name: curves[name] for name in MODALITIES if name in curves}
    )
    write_atomically(file, with_calibrations(file.read_bytes(), calibrations))
    write_calibrations(checkpoint, calibrations)
    return str(calibrations)
