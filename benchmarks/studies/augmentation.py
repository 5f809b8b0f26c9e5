"""Accuracy of DepthCN's network without and with augmentation of what it learns from (Table 7.8)."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.studies.report import Study
from perception.cli.progress import frame_progress_bar
from perception.cli.table import Cell, format_table
from perception.cli.training import import_trainer
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.types import Method
from train.config import TrainingRun
from train.verifier.config import VerifierExperiment

if TYPE_CHECKING:
    from train.verifier.run import TrainedVerifier

# By whether the training set was augmented: accuracy on it and on the validation set.
THESIS_PERCENT = {False: (92.83, 86.69), True: (96.45, 91.93)}
_NAMES = {False: "without augmentation", True: "with augmentation"}
_FOLDERS = {False: "without", True: "with"}
_LOGGED = ("train/accuracy", "validation/accuracy")


@dataclass(frozen=True)
class AugmentationStudyConfig:
    """What is trained twice.

    Attributes:
        epochs: of each training.
        seed: of both.
        resume: whether to go on where an earlier study of the same folder ended.
    """

    epochs: int = 40
    seed: int = 0
    resume: bool = False


def study_augmentation(
    experiment: VerifierExperiment, plot_path: Path, config: AugmentationStudyConfig
) -> Study:
    """Train without and with augmentation in two folders beside the picture, and compare."""
    trained = {
        is_augmented: _train(experiment, plot_path, config, is_augmented)
        for is_augmented in (False, True)
    }
    _plot(plot_path, experiment.method, trained)
    return Study(
        name="augmentation",
        repeats="Table 7.8",
        table=_table(experiment.method, trained),
        numbers={_FOLDERS[key]: asdict(one) for key, one in trained.items()},
        conditions={
            "experiment": experiment,
            "config": config,
            "thesis_percent": _by_folder(THESIS_PERCENT),
        },
    )


def _train(
    experiment: VerifierExperiment,
    plot_path: Path,
    config: AugmentationStudyConfig,
    is_augmented: bool,
) -> "TrainedVerifier":
    out = plot_path.with_suffix("") / _FOLDERS[is_augmented]
    resume = "last" if config.resume and (out / "last.ckpt").exists() else None
    trainer = import_trainer("train.verifier.run")
    trained: TrainedVerifier = trainer.run_experiment(
        replace(experiment, data=replace(experiment.data, augment=is_augmented)),
        TrainingRun(epochs=config.epochs, seed=config.seed),
        out,
        resume,
        frame_progress_bar("proposals"),
    )
    return trained


def _table(method: Method, trained: "dict[bool, TrainedVerifier]") -> str:
    rows: list[list[Cell]] = []
    for is_augmented, one in trained.items():
        ours = [100 * metrics["accuracy"] for metrics in (one.training, one.validation)]
        balanced = 100 * one.validation["balanced"]
        cells = [*ours, balanced, *THESIS_PERCENT[is_augmented]]
        rows.append([_NAMES[is_augmented], one.epoch, *(f"{cell:.2f}" for cell in cells)])
    counts = next(iter(trained.values())).counts
    title = (
        f"Accuracy in %, {method} network: {counts['training_crops']} training and "
        f"{counts['validation_crops']} validation crops"
    )
    header = (
        "",
        "best epoch",
        "training",
        "validation",
        "balanced accuracy",
        "thesis training",
        "thesis validation",
    )
    return format_table(title, header, rows)


def _plot(plot_path: Path, method: Method, trained: "dict[bool, TrainedVerifier]") -> None:
    from train.progress import read_scalars

    curves = []
    for is_augmented, one in trained.items():
        found = read_scalars(one.checkpoint.parent, _LOGGED)
        for part, values in zip(("training", "validation"), found.values(), strict=True):
            epochs = range(1, len(values) + 1)
            curves.append(Curve(f"{_NAMES[is_augmented]}, {part}", epochs, 100 * values))
    title = f"Accuracy while learning, {method} network (training: as changed, half vehicles)"
    plot_curves(plot_path, title, [CurvePanel("", "epoch", "accuracy [%]", curves)])


def _by_folder(percent: dict[bool, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    return {_FOLDERS[key]: value for key, value in percent.items()}
