"""Accuracy of DepthCN's network without and with augmentation of its training data (Table 7.8)."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.studies.report import RESULTS, formatted_table, publish
from data.samples.crops.config import CropDataConfig
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
_DATA = CropDataConfig()


def augmentation(
    drives: list[Path],
    *,
    training: TrainingFlags,
    method: Method = "thesis",
    epochs: int = 40,
    data: CropDataConfig = _DATA,
    out: Path = RESULTS / "augmentation.png",
) -> None:
    """Train DepthCN's network without and with augmentation; print its accuracies beside Table 7.8.

    Example: trifuse study augmentation synth/train --validation synth/val

    Args:
        drives: Labelled training drives.
        method: Network: that of Fig. 6.5 with its own schedule, thesis, or default.
        epochs: Number of epochs of each training.
        data: Split, batches, sampling and magnitudes of the augmentation.
        out: Figure; the numbers and both trainings are written beside it.
    """
    experiment = VerifierExperiment(training.drives(drives), VERIFIER_CONFIGS[method], data)
    run = training.run(epochs)
    trained = {name: _train(experiment, run, name, out, training.resume) for name in THESIS_PERCENT}
    _plot(out, method, trained)
    publish(
        out,
        "Table 7.8",
        {"accuracy": _table(method, trained)},
        {"experiment": experiment, "run": run},
        trained={name: asdict(one) for name, one in trained.items()},
    )


def _train(
    experiment: VerifierExperiment, run: TrainingRun, name: str, plot_path: Path, resume: str | None
) -> "TrainedVerifier":
    out = plot_path.with_suffix("") / name
    is_resumed = resume == "last" and (out / LAST).exists()
    folder = TrainingFolder.open(out, "last" if is_resumed else None, lambda: None)
    variant = replace(experiment, data=replace(experiment.data, augment=name == "with"))
    trained: TrainedVerifier = import_trainer("train.verifier.run").run_experiment(
        variant, run, folder, frame_progress_bar("proposals")
    )
    return trained


def _table(method: Method, trained: Mapping[str, "TrainedVerifier"]) -> Table[Any]:
    counts = next(iter(trained.values())).counts
    title = (
        f"Accuracy in %, {method} network: {counts['training_crops']} training and "
        f"{counts['validation_crops']} validation crops"
    )
    percents = ("training", "validation", "balanced accuracy")
    published = ("thesis training", "thesis validation")
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
    specs = {"best epoch": "d", **dict.fromkeys((*percents, *published), ".2f")}
    return formatted_table(title, "", specs, rows)


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
