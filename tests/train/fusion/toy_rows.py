"""Rows that a small network fits in a moment, and a training of them by the command line."""

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from export.trained_fusion import FUSION
from train.cli import TrainingCLI
from train.fusion.datamodule import FusionDataModule
from train.fusion.targets import FusionRows
from train.fusion.training import FusionTraining

LM = "LevenbergMarquardt"
WHOLE = (LM, "LBFGS")  # take all rows at once


def toy_rows(count: int = 60, seed: int = 0, features: int = 3) -> FusionRows:
    rng = np.random.default_rng(seed)
    inputs = rng.uniform(0, 1, (count, features)).astype(np.float32)
    three = inputs[:, :3]
    targets = np.clip(three.mean(axis=1, keepdims=True) + 0.3 * three * three[:, ::-1], 0, 1)
    weights = rng.choice([0.0, 0.5, 1.0], (count, 3)).astype(np.float32)
    return FusionRows(inputs, targets.astype(np.float32), weights)


class ToyRows(FusionDataModule):
    training_data = "toys"

    @cached_property
    def detections(self) -> SimpleNamespace:
        return SimpleNamespace(detectors="toy", class_names=("Car",), provenance={})

    @cached_property
    def training(self) -> FusionRows:
        return toy_rows(80, 0)

    @cached_property
    def validation(self) -> FusionRows:
        return toy_rows(40, 1)

    @cached_property
    def test(self) -> FusionRows:
        return toy_rows(40, 2)


class KilledFusion(FusionTraining):
    """Is stopped by Ctrl-C in the middle of an epoch."""

    at: int

    def training_step(self, batch, batch_idx):
        if self.trainer.global_step == self.at:
            raise KeyboardInterrupt
        return super().training_step(batch, batch_idx)


def toy_words(optimizer: str = LM, epochs: int = 8, *more: str) -> list[str]:
    words = [
        "--data.drives=[toys]",
        "--model.variant=scores",
        "--model.hidden=[4]",
        f"--trainer.max_epochs={epochs}",
    ]
    words += [f"--optimizer={optimizer}", "--trainer.enable_progress_bar=false"]
    words += [f"--data.batch_size={'null' if optimizer in WHOLE else 20}"]
    return [*words, *more]


TOY_FUSION = replace(FUSION, data=ToyRows, report=lambda *_: {})


def train_toy(
    out: Path,
    words: list[str],
    resume: Path | None = None,
    module: type[FusionTraining] = FusionTraining,
    data: type[FusionDataModule] = ToyRows,
) -> FusionTraining:
    """Train in a folder; return the module."""
    kind = replace(TOY_FUSION, module=module, data=data)
    cli = TrainingCLI(kind, [*words, f"--trainer.default_root_dir={out}"])
    cli.run("fit", resume)
    return cli.model
