"""From candidates to a trained verifier, and what it comes to on what it learned from and on the rest."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from lightning.pytorch import Trainer
from torch.utils.data import DataLoader

from data.crops.datamodule import CropDataModule
from data.crops.dataset import CropDataset
from data.crops.previews import augmentation_previews, preview_rows
from perception.types import UInt8
from train.networks.depthcn import VehicleVerifier, load_verifier
from train.trainer import BEST, TrainerConfig, fit, make_trainer
from train.verifier.images import VerifierImages
from train.verifier.metrics import VerifierMetrics
from train.verifier.training import VerifierTraining, VerifierTrainingConfig

_SHOWN_SAMPLES = 8
_EVALUATION_BATCH = 256

MetricValues = dict[str, float]


@dataclass(frozen=True)
class TrainedVerifier:
    """What a training leaves.

    Attributes:
        checkpoint: of the best epoch.
        epoch: its number, from 1.
        counts: candidates and vehicles of both parts.
        training: figures of the best epoch's network on what it learned from, unchanged.
        validation: the same on what was kept back.
    """

    checkpoint: Path
    epoch: int
    counts: dict[str, int]
    training: MetricValues
    validation: MetricValues


def train_verifier(
    data: CropDataModule,
    config: VerifierTrainingConfig,
    trainer_config: TrainerConfig,
    out: Path,
    resume: Path | None = None,
) -> TrainedVerifier | None:
    """Train; return what came of it, or None in all processes but the first, and of a trial.

    Args:
        data: candidates.
        config: which network, and how it descends.
        trainer_config: how long and on what.
        out: the folder.
        resume: a checkpoint to go on from.
    """
    torch.manual_seed(trainer_config.seed)
    module = VerifierTraining(config)
    images = VerifierImages(lambda: _augmentations(data))
    trainer: Trainer = make_trainer(out, trainer_config, [images])
    fit(trainer, module, data, resume)
    if trainer_config.fast_dev_run or not trainer.is_global_zero:
        return None
    return _evaluate_best(data, out / BEST)


def evaluate(network: VehicleVerifier, samples: CropDataset, workers: int = 0) -> MetricValues:
    """Return the figures of a network over samples as they are."""
    metrics = VerifierMetrics()
    loader = DataLoader(samples, _EVALUATION_BATCH, num_workers=workers)
    with torch.inference_mode():
        for batch in loader:
            logits, shares = network.heads(batch["crops"])
            metrics.update(logits, shares, batch["is_vehicle"], batch["normalized_box"])
    return {name: float(value) for name, value in metrics.compute().items()}


def _evaluate_best(data: CropDataModule, checkpoint: Path) -> TrainedVerifier:
    network, hyper_parameters = load_verifier(checkpoint)
    parts = {"training": data.training, "validation": data.validation}
    counts = {}
    for name, samples in parts.items():
        counts[f"{name}_candidates"] = len(samples)
        counts[f"{name}_vehicles"] = int(samples.crops.is_vehicle.sum())
    return TrainedVerifier(
        checkpoint,
        int(hyper_parameters["epochs"]),
        counts,
        **{
            name: evaluate(network, samples, data.loading.workers)
            for name, samples in parts.items()
        },
    )


def _augmentations(data: CropDataModule) -> Mapping[str, UInt8]:
    if data.augmentation is None:
        return {}
    rows = preview_rows(data.training, _SHOWN_SAMPLES)
    return augmentation_previews(data.training, data.augmentation, rows)
