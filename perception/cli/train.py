"""`trifuse train`: the networks of the detectors, of their fusion, and of DepthCN (6.1, 6.2, 7.2)."""

import importlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from data.detections.config import DetectorModelPaths, FusionDataConfig
from data.results.command_config import CommandConfig
from data.samples.config import TrainingDrives
from data.samples.crops.config import CropDataConfig
from data.samples.images.config import ImageDataConfig
from perception.cli.flags import require_drives
from perception.cli.parser import FlagGroup, defaults_by
from perception.detection.config import FusionVariant
from perception.errors import MissingDependencyError, WriteError
from perception.evaluation.report import Column, Table
from perception.types import Method, Modality
from train.config import OptimizerConfig, TrainerConfig, TrainingRun
from train.detector.config import (
    DETECTOR_PRESETS,
    DetectionLossConfig,
    DetectorExperiment,
    DetectorModelConfig,
    InitialWeights,
    Preset,
)
from train.folder import TrainingFolder
from train.fusion.config import (
    FUSION_VARIANTS,
    FusionExperiment,
    FusionFitConfig,
    FusionTrainingConfig,
)
from train.verifier.config import VERIFIER_CONFIGS, VerifierExperiment

_RESULTS = Path("results")
# Module of each training, and what it reads with a progress bar.
_TRAINERS = {
    "train detector": ("train.detector.run", "images"),
    "train depthcn": ("train.verifier.run", "proposals"),
    "train fusion": ("export.trained_fusion", "detections"),
}
_TRAINER, _DETECTOR_TRAINER = TrainerConfig(), TrainerConfig(precision="auto")
_MODEL, _IMAGES, _LOSS = DetectorModelConfig(), ImageDataConfig(), DetectionLossConfig()
_DETECTOR_OPTIMIZER, _WEIGHTS = DETECTOR_PRESETS["default"].optimizer, InitialWeights()
_CROPS, _VERIFIER_OPTIMIZER = CropDataConfig(), VERIFIER_CONFIGS["default"].optimizer
_MODELS, _DETECTIONS, _FIT = DetectorModelPaths(), FusionDataConfig(), FUSION_VARIANTS["default"]


@dataclass(frozen=True)
class TrainingFlags(FlagGroup):
    """Training.

    Attributes:
        validation: Labelled drives for validation, with commas between them; else a fraction of the frames is
            kept back.
        resume: Checkpoint to resume from, or the word last for that of the folder.
        seed: Seed of weights, split, order and augmentation.
    """

    validation: list[Path] | None = None
    resume: str | None = None
    seed: int = 0

    def drives(self, training: list[Path]) -> TrainingDrives:
        """Return the drives for training and validation."""
        require_drives(training)
        return TrainingDrives(tuple(training), tuple(self.validation or ()))

    def run(self, epochs: int, trainer: TrainerConfig = _TRAINER) -> TrainingRun:
        """Return epochs, devices and seed."""
        return TrainingRun(**vars(trainer), epochs=epochs, seed=self.seed)


@defaults_by(
    "preset",
    {
        name: {"optimizer": one.optimizer, "loss": one.loss, "data.batch_size": one.batch_size}
        for name, one in DETECTOR_PRESETS.items()
    },
)
def train_detector(
    drives: list[Path],
    *,
    modality: Modality,
    training: TrainingFlags,
    config: CommandConfig,
    preset: Preset = "default",
    epochs: int = 40,
    out: Path = _RESULTS / "detector",
    model: DetectorModelConfig = _MODEL,
    data: ImageDataConfig = _IMAGES,
    optimizer: OptimizerConfig = _DETECTOR_OPTIMIZER,
    loss: DetectionLossConfig = _LOSS,
    weights: InitialWeights = _WEIGHTS,
    trainer: TrainerConfig = _DETECTOR_TRAINER,
) -> None:
    """Train an image detector of one modality; watch it with: tensorboard --logdir OUT.

    It writes best.ckpt, of the highest moderate AP on the validation set, last.ckpt to resume from, config.yaml and
    metrics.json. Make a model file of the best one with: trifuse export OUT/best.ckpt --out dm.onnx

    Example: trifuse train detector synth/train --modality dm --validation synth/val --out results/dm

    Args:
        drives: Labelled drives of any layout; of a folder of several, all are taken.
        modality: Camera image, rgb; depth map, dm; or reflectance map, rm.
        preset: Defaults of optimizer, loss and batch size: default, or those of 7.2.2, thesis, for yolov2.
        epochs: Number of epochs.
        out: Folder of the results.
        model: Network and its input.
        data: Split, batches and augmentation.
        optimizer: Optimizer and learning rate.
        loss: Terms of the loss.
        weights: Initial weights.
        trainer: Devices and precision.
    """
    experiment = DetectorExperiment(
        training.drives(drives), modality, model, data, optimizer, loss, weights
    )
    run = training.run(epochs, trainer)
    trained = _run(config, experiment, run, out, training.resume)
    if trained is not None:
        frames = trained.counts["validation_frames"]
        title = f"{model.network} on {modality}, epoch {trained.epoch}: AP [%] on {frames} validation frames"
        columns = _columns(("easy", "moderate", "hard"))
        _report(Table(title, columns, trained.precision, "class, min IoU"), trained, out)


@defaults_by(
    "method", {name: {"optimizer": one.optimizer} for name, one in VERIFIER_CONFIGS.items()}
)
def train_depthcn(
    drives: list[Path],
    *,
    training: TrainingFlags,
    config: CommandConfig,
    method: Method = "default",
    epochs: int = 40,
    out: Path = _RESULTS / "depthcn",
    data: CropDataConfig = _CROPS,
    optimizer: OptimizerConfig = _VERIFIER_OPTIMIZER,
    trainer: TrainerConfig = _TRAINER,
) -> None:
    """Train the network that verifies proposals; watch it with: tensorboard --logdir OUT.

    It writes best.ckpt, of the highest balanced accuracy on the validation set, last.ckpt to resume from, config.yaml
    and metrics.json. Make a model file of the best one with: trifuse export OUT/best.ckpt --out depthcn.onnx

    Example: trifuse train depthcn synth/train --validation synth/val --out results/depthcn

    Args:
        drives: Labelled drives of any layout; of a folder of several, all are taken.
        method: Network, its input and its optimizer: default, the one that ships; or thesis, Fig. 6.5.
        epochs: Number of epochs, each with as many samples as there are crops.
        out: Folder of the results.
        data: Split, batches, sampling and augmentation.
        optimizer: Optimizer and learning rate.
        trainer: Devices and precision.
    """
    experiment = VerifierExperiment(
        training.drives(drives), replace(VERIFIER_CONFIGS[method], optimizer=optimizer), data
    )
    run = training.run(epochs, trainer)
    trained = _run(config, experiment, run, out, training.resume)
    if trained is not None:
        counts = ("crops", "vehicles")
        rows = {
            part: {name: trained.counts[f"{part}_{name}"] for name in counts}
            | {name: 100 * value for name, value in metrics.items()}
            for part, metrics in (
                ("training", trained.training),
                ("validation", trained.validation),
            )
        }
        columns = [*_columns(counts, ""), *_columns(trained.validation)]
        title = f"DepthCN, {method}, epoch {trained.epoch}: metrics in %"
        _report(Table(title, columns, rows, "set"), trained, out)


@defaults_by("variant", {name: {"fit": one} for name, one in FUSION_VARIANTS.items()})
def train_fusion(
    drives: list[Path],
    *,
    training: TrainingFlags,
    config: CommandConfig,
    variant: FusionVariant = "default",
    epochs: int = 4,
    sweep: tuple[int, ...] = (),
    sweep_two: tuple[int, ...] = (),
    out: Path = _RESULTS / "fusion",
    models: DetectorModelPaths = _MODELS,
    data: FusionDataConfig = _DETECTIONS,
    fit: FusionFitConfig = _FIT,
) -> None:
    """Fit the fusion to drives that no detector was trained on; watch it with: tensorboard --logdir OUT.

    The detectors run once on every frame; their detections are cached. It writes fusion.onnx, best.ckpt, last.ckpt to
    resume from, config.yaml, metrics.json, and plots: rescoring.png (Fig. 7.12), steps.png (7.14), reliability.png, and
    with a sweep sizes.png (7.13).

    Example: trifuse train fusion synth/fusion --variant features --sweep 5,10,20,40 --out results/fusion

    Args:
        drives: Labelled drives of any layout; of a folder of several, all are taken.
        variant: Features and defaults of the fit: default, with distances, overlaps and missing detectors;
            features or scores, as in the thesis.
        epochs: Number of epochs of AdamW; more fit synthetic drives better, and real ones worse.
        sweep: Numbers of neurons of one hidden layer to try; the best of all sizes is taken.
        sweep_two: Numbers of neurons of two hidden layers, of which all falling pairs are tried.
        out: Folder of the results.
        models: Model files of the detectors; else those that ship.
        data: Split and cache.
        fit: Hidden layers, and how they are fitted.
    """
    network = FusionTrainingConfig(**vars(fit), variant=variant)
    experiment = FusionExperiment(training.drives(drives), network, models, data, sweep, sweep_two)
    run = training.run(epochs, replace(_TRAINER, accelerator="cpu"))
    trained = _run(config, experiment, run, out, training.resume)
    title = (
        f"Fusion, {variant}, {trained.metadata['hidden']} neurons, mean square error "
        f"{trained.fitted.validation:.4f}: AP [%] on {trained.counts['test_frames']} test frames"
    )
    columns = _columns(("easy", "moderate", "hard"))
    table = Table(title, columns, trained.test_ap_percent, "Car, min IoU 0.7")
    _report(table, trained, out, trained.file)


def _run(
    config: CommandConfig, experiment: object, run: TrainingRun, out: Path, resume: str | None
) -> Any:  # noqa: ANN401 - what the module returns
    from perception.cli.progress import frame_progress_bar

    module, progress = _TRAINERS[config.command]
    run_experiment = import_trainer(module).run_experiment
    folder = TrainingFolder.open(out, resume, lambda: config.write(out))
    try:
        return run_experiment(experiment, run, folder, frame_progress_bar(progress))
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt(_how_to_go_on(config, folder)) from error
    except WriteError as error:
        advice = f"make room, then {_how_to_go_on(config, folder)}"
        raise WriteError(
            error.where, expected=error.expected, found=error.found, advice=advice
        ) from error


def _how_to_go_on(config: CommandConfig, folder: TrainingFolder) -> str:
    if not folder.last.exists():
        return "start again with the same command, as no epoch is complete"
    flags = f"--config {folder.out / 'config.yaml'} --out {folder.out} --resume last"
    return f"go on with: trifuse {config.command} {flags}"


def import_trainer(module: str) -> Any:  # noqa: ANN401 - a module
    """Import a module that needs torch and Lightning.

    Raises:
        MissingDependencyError: they are not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingDependencyError(
            "torch, lightning and tensorboard", needed_for="training", extra="train", reason=error
        ) from error


def _columns(names: Iterable[str], spec: str = ".2f") -> list[Column[Mapping[str, float]]]:
    return [
        Column(name.replace("_", " "), lambda row, name=name: row.get(name), spec, name)  # type: ignore[misc]
        for name in names
    ]


def _report(
    table: Table[Mapping[str, float]],
    trained: Any,  # noqa: ANN401
    out: Path,
    file: Path | None = None,
) -> None:
    from data.results.documents import write_json

    write_json(out / "metrics.json", trained)
    print(f"{table.text()}\n\n{file or trained.checkpoint}\n{out / 'metrics.json'}")
