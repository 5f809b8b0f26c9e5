"""Flags that all trainings share, and the import of what needs torch."""

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from data.samples.config import TrainingDrives
from perception.cli.flags import require_drives
from perception.cli.parser import FlagGroup
from perception.errors import MissingDependencyError
from train.config import TrainerConfig, TrainingRun


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

    def run(self, epochs: int, trainer: TrainerConfig) -> TrainingRun:
        """Return epochs, devices and seed."""
        return TrainingRun(**vars(trainer), epochs=epochs, seed=self.seed)


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
