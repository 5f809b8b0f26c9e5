"""Training of DepthCN's network from labelled drives to the checkpoint of its best epoch."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch.utils.data import DataLoader

from data.samples.crops.datamodule import CropDataModule
from data.samples.crops.dataset import CropDataset
from data.samples.crops.labelled_frames import CropConfig
from data.samples.crops.previews import augmentation_previews, preview_rows
from perception.types import Progress, UInt8
from train.best_epoch import Criterion
from train.checkpoints import program_revision
from train.config import TrainingRun
from train.folder import TrainingFolder
from train.networks.depthcn import VERIFIER_INPUTS, VehicleVerifier, load_verifier
from train.trainer import fit
from train.verifier.config import VerifierExperiment
from train.verifier.images import VerifierImages
from train.verifier.metrics import VerifierMetrics
from train.verifier.training import VerifierTraining

RANKING = (
    Criterion("validation/balanced_accuracy"),
    Criterion("validation/loss", is_lower_better=True),
)
_SHOWN_SAMPLES = 8
_EVALUATION_BATCH = 256

MetricValues = dict[str, float]


@dataclass(frozen=True)
class TrainedVerifier:
    """Result of a training.

    Attributes:
        checkpoint: Checkpoint of the best epoch.
        epoch: Number of the best epoch, from 1.
        counts: Crops and vehicles of training and validation.
        training: Metrics of the best network on the training set, not augmented.
        validation: Metrics of the best network on the validation set.
    """

    checkpoint: Path
    epoch: int
    counts: dict[str, int]
    training: MetricValues
    validation: MetricValues


def run_experiment(
    experiment: VerifierExperiment,
    run: TrainingRun,
    folder: TrainingFolder,
    progress: Progress = iter,
) -> TrainedVerifier | None:
    """Train a verifier in a folder; return its result, in the first process only.

    Args:
        experiment: All settings of the network.
        run: Epochs, devices and seed.
        folder: Folder of the training.
        progress: Wrapper of the loop over frames that may show its progress.

    Raises:
        PerceptionError: settings, drives or a checkpoint cannot be used.
    """
    config = replace(
        experiment.network, training_data=experiment.drives.names, revision=program_revision()
    )
    inputs = VERIFIER_INPUTS[config.method]
    crop = CropConfig(config.method, window=inputs.window, channels=inputs.channels)
    data = CropDataModule(experiment.drives, experiment.data, crop, run.seed, progress)
    torch.manual_seed(run.seed)
    images = VerifierImages(lambda: _augmentations(data))
    best = fit(VerifierTraining(config), data, RANKING, run, folder, [images])
    return None if best is None else _result(data, best)


def evaluate(network: VehicleVerifier, samples: CropDataset, workers: int = 0) -> MetricValues:
    """Return the metrics of a network on samples without augmentation."""
    metrics = VerifierMetrics()
    loader = DataLoader(samples, _EVALUATION_BATCH, num_workers=workers)
    with torch.inference_mode():
        for batch in loader:
            logits, shares = network.heads(batch["crops"])
            metrics.update(logits, shares, batch["is_vehicle"], batch["normalized_box"])
    return {name: float(value) for name, value in metrics.compute().items()}


def _result(data: CropDataModule, checkpoint: Path) -> TrainedVerifier:
    network, hyper_parameters = load_verifier(checkpoint)
    parts = {"training": data.training, "validation": data.validation}
    counts = {}
    for name, samples in parts.items():
        counts[f"{name}_crops"] = len(samples)
        counts[f"{name}_vehicles"] = int(samples.crops.is_vehicle.sum())
    return TrainedVerifier(
        checkpoint,
        int(hyper_parameters["epochs"]),
        counts,
        **{
            name: evaluate(network, samples, data.config.workers) for name, samples in parts.items()
        },
    )


def _augmentations(data: CropDataModule) -> Mapping[str, UInt8]:
    if data.augmentation is None:
        return {}
    rows = preview_rows(data.training, _SHOWN_SAMPLES)
    return augmentation_previews(data.training, data.augmentation, rows)
