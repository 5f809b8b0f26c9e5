"""Training of the bird's-eye-view detector from labelled drives to the average precision of its best epoch."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from data.samples.bev.datamodule import BevDataModule
from perception.evaluation.report import Column, Table
from train.bev.metrics import DISTANCE_M
from train.bev.networks import MODEL
from train.bev.training import BevTraining
from train.checkpoints import read_checkpoint
from train.cli import Stage, TrainingKind


@dataclass(frozen=True)
class BevResult:
    """Average precision of a checkpoint.

    Attributes:
        checkpoint: Checkpoint.
        epoch: Number of its epoch, from 1.
        part: Part of the data that was evaluated: validation or test.
        counts: Scans of the parts of the data.
        precision: Average precision, number of labels and recall of each class.
    """

    checkpoint: Path
    epoch: int
    part: str
    counts: Mapping[str, int]
    precision: Mapping[str, Mapping[str, float]]

    @property
    def table(self) -> Table[Mapping[str, float]]:
        """Table of the average precision."""
        scans = f"{self.counts[f'{self.part}_frames']} {self.part} scans"
        title = f"bev, epoch {self.epoch}: centres within {DISTANCE_M:g} m on {scans}"
        columns = [
            Column[Mapping[str, float]]("AP [%]", partial(_percent, "ap"), ".1f"),
            Column[Mapping[str, float]]("mean AP [%]", partial(_percent, "mean_ap"), ".1f"),
            Column[Mapping[str, float]]("labels", lambda row: row["labels"], "d"),
            Column[Mapping[str, float]]("recall [%]", partial(_percent, "recall"), ".1f"),
        ]
        return Table(title, columns, self.precision, "class")


def _percent(name: str, row: Mapping[str, float]) -> float | None:
    """Return a metric in percent; None of a class without labels, and of a checkpoint that does not state it."""
    return 100 * row[name] if name in row and row["labels"] else None


def report(module: BevTraining, data: BevDataModule, stage: Stage, checkpoint: Path) -> BevResult:
    """Return the average precision of the best epoch on the validation data, or of an evaluation."""
    content = read_checkpoint(checkpoint, MODEL)
    part = "test" if stage == "test" else "validation"
    names = ("training", "validation") if stage == "fit" else (part,)
    counts = {f"{name}_frames": len(getattr(data, name)) for name in names}
    precision = content["precision"]  # of its own validation
    if stage != "fit":
        precision = {name: vars(one) for name, one in module.metrics.items()}
    return BevResult(checkpoint, content["epoch"] + 1, part, counts, precision)


BEV = TrainingKind(
    "bev",
    BevTraining,
    BevDataModule,
    report,
    defaults={"trainer.gradient_clip_val": 10.0, "ema.decay": 0.998},
    links={"bev": "bev"},
)
