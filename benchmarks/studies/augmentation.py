"""Accuracy of DepthCN's network without and with augmentation of its training data (Table 7.8)."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.studies.report import RESULTS, formatted_table, publish
from data.samples.crops.config import CropDataConfig
from perception.cli.parser import FlagGroup
from perception.cli.progress import frame_progress_bar
from perception.cli.train import TrainingFlags, import_trainer
from perception.evaluation.report import Table
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.types import Method
from train.config import TrainingRun
from train.folder import LAST, TrainingFolder
from train.verifier.config import VERIFIER_CONFIGS, VerifierExperiment

if TYPE_CHECKING:
    from train.verifier.run import TrainedVerifier

# Accuracy on the training and on the validation set in percent.
THESIS_PERCENT = {"without": (92.83, 86.69), "with": (96.45, 91.93)}
_LOGGED = ("train/accuracy", "validation/accuracy")


@dataclass(frozen=True)
class AugmentationStudyConfig(FlagGroup):
    """Settings of both trainings.

    Attributes:
        method: Network: that of Fig. 6.5 with its own schedule, thesis, or default.
        epochs: Number of epochs.
        batch: Crops per batch.
        workers: Number of processes that load samples.
        cache: Folder for cached images and proposals; else the user's cache folder.
    """

    method: Method = "thesis"
    epochs: int = 40
    batch: int = 128
    workers: int = 0
    cache: Path | None = None


def augmentation(
    drives: list[Path],
    *,
    training: TrainingFlags,
    config: AugmentationStudyConfig,
    out: Path = RESULTS / "augmentation.png",
) -> None:
    """Train DepthCN's network without and with augmentation; print its accuracies beside Table 7.8.

    Example: trifuse study augmentation synth/train --validation synth/val

    Args:
        drives: Labelled training drives.
        out: Figure; the numbers and both trainings are written beside it.
    """
    experiment = VerifierExperiment(
        training.drives(drives),
        VERIFIER_CONFIGS[config.method],
        CropDataConfig(batch_size=config.batch, workers=config.workers, cache=config.cache),
    )
    run = TrainingRun(epochs=config.epochs, seed=training.seed)
    trained = {name: _train(experiment, run, name, out, training.resume) for name in THESIS_PERCENT}
    _plot(out, config.method, trained)
    publish(
        out,
        "Table 7.8",
        {"accuracy": _table(config.method, trained)},
        {"experiment": experiment, "run": run},
        trained={name: asdict(one) for name, one in trained.items()},
    )


def _train(
    experiment: VerifierExperiment, run: TrainingRun, name: str, plot_path: Path, resume: str | None
) -> "TrainedVerifier":
    out = plot_path.with_suffix("") / name
    is_resumed = resume == "last" and (out / LAST).exists()
    data = replace(experiment.data, augment=name == "with")
    trained: TrainedVerifier = import_trainer("train.verifier.run").run_experiment(
        replace(experiment, data=data),
        run,
        TrainingFolder(out, out / LAST if is_resumed else None),
        frame_progress_bar("proposals"),
    )
    return trained


def _table(method: Method, trained: Mapping[str, "TrainedVerifier"]) -> Table[Any]:
    counts = next(iter(trained.values())).counts
    title = (
        f"Accuracy in %, {method} network: {counts['training_crops']} training and "
        f"{counts['validation_crops']} validation crops"
    )
    percents = (
        "training",
        "validation",
        "balanced accuracy",
        "thesis training",
        "thesis validation",
    )
    rows = {
        f"{name} augmentation": (
            one.epoch,
            100 * one.training["accuracy"],
            100 * one.validation["accuracy"],
            100 * one.validation["balanced_accuracy"],
            *THESIS_PERCENT[name],
        )
        for name, one in trained.items()
    }
    return formatted_table(title, "", {"best epoch": "d", **dict.fromkeys(percents, ".2f")}, rows)


def _plot(plot_path: Path, method: Method, trained: Mapping[str, "TrainedVerifier"]) -> None:
    from train.events import read_scalars

    curves = []
    for name, one in trained.items():
        found = read_scalars(one.checkpoint.parent, _LOGGED)
        for part, values in zip(("training", "validation"), found.values(), strict=True):
            curves.append(
                Curve(f"{name} augmentation, {part}", range(1, len(values) + 1), 100 * values)
            )
    title = f"Accuracy during training, {method} network (training: augmented, half vehicles)"
    plot_curves(plot_path, title, [CurvePanel("", "epoch", "accuracy [%]", curves)])
