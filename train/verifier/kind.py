"""Training of DepthCN's network from labelled drives to metrics of its best epoch."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from torch.utils.data import DataLoader

from data.samples.crops.datamodule import CropDataModule
from data.samples.crops.dataset import CropDataset
from perception.evaluation.report import Column, Table
from train.checkpoints import read_checkpoint
from train.cli import Stage, TrainingKind
from train.networks.depthcn import MODEL, VehicleVerifier, load_verifier, object_logits
from train.verifier.metrics import VerifierMetrics
from train.verifier.training import VerifierTraining

_EVALUATION_BATCH = 256
_COUNTS = ("crops", "vehicles")

MetricValues = dict[str, float]


@dataclass(frozen=True)
class VerifierResult:
    """Metrics of a checkpoint.

    Attributes:
        checkpoint: Checkpoint.
        method: Network: default or thesis.
        epoch: Number of its epoch, from 1.
        parts: Metrics, crops and vehicles by part of the data: training, which is not augmented; validation; or test.
    """

    checkpoint: Path
    method: str
    epoch: int
    parts: Mapping[str, MetricValues]

    @property
    def table(self) -> Table[MetricValues]:
        """Table of the metrics in percent."""
        names = dict.fromkeys(name for values in self.parts.values() for name in values)
        columns = [_column(name) for name in names]
        title = f"DepthCN, {self.method}, epoch {self.epoch}: metrics in %"
        return Table(title, columns, self.parts, "set")


def evaluate(network: VehicleVerifier, samples: CropDataset, workers: int = 0) -> MetricValues:
    """Return the metrics of a network on samples without augmentation."""
    # One process of a training evaluates, when the others may have ended.
    metrics = VerifierMetrics(sync_on_compute=False)
    loader = DataLoader(samples, _EVALUATION_BATCH, num_workers=workers)
    with torch.inference_mode():
        for batch in loader:
            logits, shares = network.heads(batch["crops"])
            metrics.update(
                object_logits(logits), shares, batch["is_vehicle"], batch["normalized_box"]
            )
    return {name: float(value) for name, value in metrics.compute().items()}


def report(
    module: VerifierTraining, data: CropDataModule, stage: Stage, checkpoint: Path
) -> VerifierResult:
    """Return the metrics of the best epoch on training and validation data, or of an evaluation."""
    epoch = read_checkpoint(checkpoint, MODEL)["epoch"] + 1
    method = module.hparams["method"]
    if stage == "fit":
        network, _ = load_verifier(checkpoint)
        parts = {"training": data.training, "validation": data.validation}
        metrics = {
            name: evaluate(network, samples, data.workers) for name, samples in parts.items()
        }
    else:
        name = "validation" if stage == "validate" else "test"
        parts, metrics = {name: getattr(data, name)}, {name: module.metrics}
    rows = {
        name: {"crops": len(samples), "vehicles": int(samples.crops.is_vehicle.sum())}
        | metrics[name]
        for name, samples in parts.items()
    }
    return VerifierResult(checkpoint, method, epoch, rows)


def _column(name: str) -> Column[MetricValues]:
    if name in _COUNTS:
        return Column(name, lambda row: row[name], "d", name)
    return Column(name.replace("_", " "), lambda row: 100 * row[name], ".2f", name)


DEPTHCN = TrainingKind(
    "depthcn",
    VerifierTraining,
    CropDataModule,
    report,
    defaults={"trainer.precision": "32-true"},
    links={"crop": "crop"},
)
