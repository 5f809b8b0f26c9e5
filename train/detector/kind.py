"""Training of a detector from labelled drives to the average precision of its best epoch."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from data.samples.images.datamodule import ImageDataModule
from data.samples.images.dataset import Samples
from perception.evaluation.detection.class_precision import level_columns
from perception.evaluation.report import Table
from train.checkpoints import read_checkpoint
from train.cli import Stage, TrainingKind
from train.detector.metrics import precision_table
from train.detector.networks import MODEL
from train.detector.training import DetectorTraining


@dataclass(frozen=True)
class DetectorResult:
    """Average precision of a checkpoint.

    Attributes:
        checkpoint: Checkpoint.
        network: Name of the network.
        modality: Modality of the network.
        epoch: Number of its epoch, from 1.
        part: Part of the data that was evaluated: validation or test.
        counts: Frames and labels of the parts of the data.
        precision: Average precision in percent, by class and IoU, then by difficulty.
    """

    checkpoint: Path
    network: str
    modality: str
    epoch: int
    part: str
    counts: Mapping[str, int]
    precision: Mapping[str, Mapping[str, float]]

    @property
    def table(self) -> Table[Mapping[str, float]]:
        """Table of the average precision."""
        frames = f"{self.counts[f'{self.part}_frames']} {self.part} frames"
        title = f"{self.network} on {self.modality}, epoch {self.epoch}: AP [%] on {frames}"
        return Table(title, level_columns(), self.precision, "class, min IoU")


def report(
    module: DetectorTraining, data: ImageDataModule, stage: Stage, checkpoint: Path
) -> DetectorResult:
    """Return the average precision of the best epoch on the validation data, or of an evaluation."""
    content, image = read_checkpoint(checkpoint, MODEL), module.image
    part = "test" if stage == "test" else "validation"
    names = ("training", "validation") if stage == "fit" else (part,)
    counts: dict[str, int] = {}
    for name in names:
        samples: Samples = getattr(data, name)
        counts[f"{name}_frames"] = len(samples)
        counts[f"{name}_labels"] = samples.target_types().total()
    precision = content["precision"]  # of its own validation
    if stage != "fit" and module.metrics is not None:
        precision = precision_table(module.metrics)
    epoch = content["epoch"] + 1
    return DetectorResult(checkpoint, image.network, image.modality, epoch, part, counts, precision)


DETECTOR = TrainingKind(
    "detector",
    DetectorTraining,
    ImageDataModule,
    report,
    # A few odd labels cause long gradients.
    defaults={"trainer.gradient_clip_val": 20.0, "ema.decay": 0.998},
    links={"image": "image"},
)
