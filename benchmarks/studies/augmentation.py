"""Accuracy of DepthCN's network without and with augmentation of its training data (Table 7.8)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.studies.detector_variants import trained
from benchmarks.studies.report import RESULTS, formatted_table, publish
from perception.evaluation.report import Table
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.types import Method

# Accuracy on the training and on the validation set in percent.
THESIS_PERCENT = {"without": (92.83, 86.69), "with": (96.45, 91.93)}
_LOGGED = ("train/accuracy", "validation/accuracy")


def augmentation(
    drives: list[Path],
    *,
    validation: list[Path] | None = None,
    method: Method = "thesis",
    epochs: int = 40,
    batch_size: int = 128,
    seed: int = 0,
    cache: Path | None = None,
    out: Path = RESULTS / "augmentation.png",
) -> None:
    """Train DepthCN's network without and with augmentation; print its accuracies beside Table 7.8.

    A training that was stopped is resumed, and one that is done is read.

    Example: trifuse study augmentation synth/train --validation synth/val

    Args:
        drives: Labelled training drives.
        validation: Labelled drives for validation, with commas between them; else a fraction of the frames.
        method: Network: that of Fig. 6.5 with its own schedule, thesis, or default.
        epochs: Number of epochs of each training.
        batch_size: Crops per batch.
        seed: Seed of weights, split, order and augmentation.
        cache: Folder for cached proposals; else the user's cache folder.
        out: Figure; the numbers and both trainings are written beside it.
    """
    arguments = {
        "data.drives": drives,
        "data.validation": validation or [],
        "data.batch_size": batch_size,
        "data.cache": cache,
        "trainer.max_epochs": epochs,
        "seed_everything": seed,
    }
    done = {
        name: trained(
            "depthcn",
            {**arguments, "data.augment": name == "with"},
            out.with_suffix("") / name,
            method,
        )
        for name in THESIS_PERCENT
    }
    _plot(out, method, done)
    publish(
        out,
        "Table 7.8",
        {"accuracy": _table(method, done)},
        {"training": {"config": method, **arguments}},
        trained=done,
    )


def _table(method: Method, done: Mapping[str, Any]) -> Table[Any]:
    parts = next(iter(done.values()))["parts"]
    title = (
        f"Accuracy in %, {method} network: {parts['training']['crops']} training and "
        f"{parts['validation']['crops']} validation crops"
    )
    percents = ("training", "validation", "balanced accuracy")
    published = ("thesis training", "thesis validation")
    rows = {
        f"{name} augmentation": (
            one["epoch"],
            100 * one["parts"]["training"]["accuracy"],
            100 * one["parts"]["validation"]["accuracy"],
            100 * one["parts"]["validation"]["balanced_accuracy"],
            *THESIS_PERCENT[name],
        )
        for name, one in done.items()
    }
    specs = {"best epoch": "d", **dict.fromkeys((*percents, *published), ".2f")}
    return formatted_table(title, "", specs, rows)


def _plot(plot_path: Path, method: Method, done: Mapping[str, Any]) -> None:
    from train.events import read_scalars

    curves = []
    for name, one in done.items():
        found = read_scalars(Path(one["checkpoint"]).parent, _LOGGED)
        for part, values in zip(("training", "validation"), found.values(), strict=True):
            curves.append(
                Curve(f"{name} augmentation, {part}", range(1, len(values) + 1), 100 * values)
            )
    title = f"Accuracy during training, {method} network (training: augmented, half vehicles)"
    plot_curves(plot_path, title, [CurvePanel("", "epoch", "accuracy [%]", curves)])
