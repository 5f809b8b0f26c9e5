"""`trifuse train fusion`: the network that fuses the detectors (6.2.4, 7.2.2)."""

import importlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from data.detections.config import DetectorModelPaths, FusionDataConfig
from data.results.command_config import CommandConfig
from data.samples.config import TrainingDrives
from perception.cli.flags import require_drives
from perception.cli.parser import FlagGroup, defaults_by
from perception.detection.config import FusionVariant
from perception.errors import MissingDependencyError, WriteError
from perception.evaluation.report import Column, Table
from train.config import TrainerConfig, TrainingRun
from train.fusion.config import (
    FUSION_VARIANTS,
    FusionExperiment,
    FusionFitConfig,
    FusionTrainingConfig,
)

if TYPE_CHECKING:
    from train.fusion.previous import TrainingFolder

_RESULTS = Path("results")
# Module of each training, and what it reads with a progress bar.
_TRAINERS = {
    "train fusion": ("export.trained_fusion", "detections"),
}
_TRAINER = TrainerConfig()
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
    from train.fusion.previous import TrainingFolder

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


def _how_to_go_on(config: CommandConfig, folder: "TrainingFolder") -> str:
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
