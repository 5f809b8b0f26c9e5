"""Sweep of the sizes of the fusion's network: training and validation error over neurons (Fig. 7.13)."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from data.results.documents import to_serializable
from train.cli import METRICS, Stage, TrainingCLI
from train.fusion.config import Hidden, SweepConfig
from train.fusion.datamodule import FusionDataModule, row_tensors
from train.fusion.gauss_newton import mean_square
from train.fusion.network import load_fusion
from train.fusion.training import FusionTraining


@dataclass(frozen=True)
class SweptSize:
    """Errors of one network at its best epoch.

    Attributes:
        hidden: Neurons of each hidden layer.
        training: Mean square error of the training rows.
        validation: Mean square error of the validation rows.
    """

    hidden: Hidden
    training: float
    validation: float


def choose_size(cli: TrainingCLI) -> None:
    """Train a network of each size of the sweep in a folder of its own, and take the best for the training itself.

    A size that is done is not repeated, and one that was stopped is resumed.

    Args:
        cli: Command line of the training, whose hidden layers become those of the lowest validation error.
    """
    swept = []
    for hidden in SweepConfig(**cli.config["model"]["sweep"]).sizes:
        folder = _folder(cli.folder.out, hidden)
        if not (folder / METRICS["fit"]).exists():
            _train(cli, hidden, folder)
        swept.append(_read(folder))
    if swept:
        cli.config["model"]["hidden"] = min(swept, key=lambda one: one.validation).hidden


def swept_sizes(out: Path, sizes: Sequence[Hidden]) -> list[SweptSize]:
    """Return the errors of the sizes that were tried for a training in a folder."""
    return [_read(_folder(out, hidden)) for hidden in sizes]


def _train(cli: TrainingCLI, hidden: Hidden, folder: Path) -> None:
    kind = replace(cli.kind, report=_report, before_fit=None)
    words = [
        f"--config={json.dumps(to_serializable(cli.command_config.values))}",
        f"--model.hidden={list(hidden)}",
        "--model.sweep={}",
        f"--trainer.default_root_dir={folder}",
    ]
    one = TrainingCLI(kind, words)
    one.run("fit", "last" if one.folder.last.exists() else None)


def _report(
    module: FusionTraining, data: FusionDataModule, stage: Stage, checkpoint: Path
) -> SweptSize:
    """Return the errors of the best epoch."""
    network, _ = load_fusion(checkpoint)
    errors = (
        float(mean_square(network, row_tensors(rows))) for rows in (data.training, data.validation)
    )
    return SweptSize(tuple(module.hparams["hidden"]), *errors)


def _folder(out: Path, hidden: Hidden) -> Path:
    return out / "sizes" / "-".join(map(str, hidden))


def _read(folder: Path) -> SweptSize:
    values = json.loads((folder / METRICS["fit"]).read_text())
    return SweptSize(tuple(values["hidden"]), values["training"], values["validation"])
