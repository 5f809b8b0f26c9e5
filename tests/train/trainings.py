"""A training on the CPU by the words of a command line."""

from pathlib import Path
from typing import Any

from train.cli import TrainingCLI, TrainingKind

# TensorBoard's events, which most tests do not read: drawing and writing them takes longer than a toy training.
LOGGED = "--trainer.logger=true"


def train(
    kind: TrainingKind, out: Path, *words: str, epochs: int = 1, resume: Path | None = None
) -> Any:
    """Return the result of a training in a folder."""
    return run(kind, out, *words, epochs=epochs, resume=resume)[1]


def run(
    kind: TrainingKind, out: Path, *words: str, epochs: int = 1, resume: Path | None = None
) -> tuple[TrainingCLI, Any]:
    """Return the command line of a training after it has run, and its result."""
    cli = cli_of(kind, out, *words, epochs=epochs)
    return cli, cli.run("fit", resume)


def cli_of(kind: TrainingKind, out: Path, *words: str, epochs: int = 1) -> TrainingCLI:
    """Return the command line of a training that has not run; it logs if `LOGGED` is among the words."""
    settings = {
        "accelerator": "cpu",
        "max_epochs": epochs,
        "default_root_dir": out,
        "logger": "false",
    }
    flags = [f"--trainer.{name}={value}" for name, value in settings.items()]
    return TrainingCLI(kind, [*flags, *words])


def killed_after(step: int) -> list[str]:
    """Return the words that stop a training after a step, as Ctrl-C does."""
    callback = "--trainer.callbacks+=tests.train.interrupted.KilledAfter"
    return [callback, f"--trainer.callbacks.step={step}"]
