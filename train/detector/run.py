"""Training of a detector from labelled drives to the checkpoint of its best epoch."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import torch
from lightning.pytorch import Callback
from lightning.pytorch.callbacks import WeightAveraging
from torch import Tensor

from data.samples.images.datamodule import ImageDataModule
from perception.detection.detectors.input_size import InputSize
from perception.errors import UsageError
from perception.types import Progress
from train.best_epoch import Criterion
from train.checkpoints import program_revision, read_checkpoint
from train.config import TrainingRun
from train.detector.config import DetectorExperiment, InitialWeights
from train.detector.darknet_weights import init_from_darknet
from train.detector.images import DetectorImages
from train.detector.networks import (
    MODEL,
    DetectorNetworkConfig,
    load_detector,
    make_detector,
    require_same_detector,
)
from train.detector.training import DetectorTraining, DetectorTrainingConfig
from train.folder import TrainingFolder
from train.networks.torchvision_detector import TorchvisionDetector, init_from_classifier
from train.networks.yolo_detector import YoloDetector
from train.networks.yolov2 import YOLOv2
from train.trainer import fit

# Average precision at KITTI's overlap is 0 in the first epochs.
RANKING = (
    Criterion("validation/moderate"),
    Criterion("validation/moderate_50"),
    Criterion("validation/loss", is_lower_better=True),
)
_RANDOM_WEIGHTS = InitialWeights()


@dataclass(frozen=True)
class TrainedDetector:
    """Result of a training.

    Attributes:
        checkpoint: Checkpoint of the best epoch.
        epoch: Number of the best epoch, from 1.
        counts: Frames and targets of training and validation.
        precision: Average precision in percent on the validation set, by class and IoU, then by difficulty.
    """

    checkpoint: Path
    epoch: int
    counts: dict[str, int]
    precision: dict[str, dict[str, float]]


def run_experiment(
    experiment: DetectorExperiment,
    run: TrainingRun,
    folder: TrainingFolder,
    progress: Progress = iter,
) -> TrainedDetector | None:
    """Train a detector in a folder; return its result, in the first process only.

    Args:
        experiment: All settings of the detector.
        run: Epochs, devices and seed.
        folder: Folder of the training.
        progress: Wrapper of the loop over frames that may show its progress.

    Raises:
        PerceptionError: settings, drives, weights or a checkpoint cannot be used.
    """
    model = experiment.model
    network = DetectorNetworkConfig(
        experiment.modality,
        model.classes,
        InputSize.parse(model.size),
        model.filling,
        experiment.data.jpeg_quality,
        model.network,
    )
    config = DetectorTrainingConfig(
        network,
        experiment.optimizer,
        experiment.loss,
        model.anchors,
        seed=run.seed,
        training_data=experiment.drives.names,
        revision=program_revision(),
    )
    data = ImageDataModule(experiment.drives, network, experiment.data, run.seed, progress)
    return train_detector(data, config, run, folder, experiment.weights)


def train_detector(
    data: ImageDataModule,
    config: DetectorTrainingConfig,
    run: TrainingRun,
    folder: TrainingFolder,
    weights: InitialWeights = _RANDOM_WEIGHTS,
) -> TrainedDetector | None:
    """Train; return the result, or None in all processes but the first and after a fast_dev_run.

    Args:
        data: Labelled images of one modality.
        config: Network, and how it is trained.
        run: Epochs, devices and seed.
        folder: Folder of the training.
        weights: Initial weights.

    Raises:
        ModelError: a checkpoint or a weight file is damaged, or of another network.
        PerceptionError: the data cannot be read or used.
    """
    if folder.resume is not None:
        require_same_detector(folder.resume, config.network)
    if weights.checkpoint is not None:
        # The meaning of its weights depends on the anchors.
        config = replace(config, anchors="default")
    torch.manual_seed(run.seed)
    module = DetectorTraining(config, initial_network(config, weights))
    best = fit(module, data, RANKING, run, folder, callbacks(config))
    return None if best is None else _result(data, best)


def initial_network(config: DetectorTrainingConfig, weights: InitialWeights) -> YoloDetector:
    """Return the network with its initial weights.

    Raises:
        ModelError: weights cannot be read, or are of another network.
        UsageError: the network does not take weights of this kind.
    """
    if weights.checkpoint is not None:
        require_same_detector(weights.checkpoint, config.network)
        network, _ = load_detector(weights.checkpoint)
        return network.train()
    network, name = make_detector(config.network), config.network.network
    if weights.darknet is not None:
        if not isinstance(network, YOLOv2):
            raise UsageError("--weights.darknet", expected="network yolov2", found=name)
        init_from_darknet(network, weights.darknet)
    if weights.backbone is not None:
        if not isinstance(network, TorchvisionDetector):
            raise UsageError(
                "--weights.backbone", expected="a classifier of torchvision", found=name
            )
        init_from_classifier(network, name, weights.backbone)
    return network


def callbacks(config: DetectorTrainingConfig) -> list[Callback]:
    """Return the callbacks that draw images and average the weights."""
    decay = config.optimizer.ema_decay
    averages = [WeightAveraging(avg_fn=partial(_averaged, decay=decay))] if decay else []
    return [*averages, DetectorImages()]


def _averaged(mean: Tensor, new: Tensor, count: Tensor | int, decay: float) -> Tensor:
    """Return the moving average; it is short at first, to forget the random weights soon."""
    now = torch.as_tensor((1 + count) / (10 + count)).clamp(max=decay)
    return mean * now + new * (1 - now)


def _result(data: ImageDataModule, checkpoint: Path) -> TrainedDetector:
    content = read_checkpoint(checkpoint, MODEL)
    counts = {}
    for name, samples in (("training", data.training), ("validation", data.validation)):
        counts[f"{name}_frames"] = len(samples)
        counts[f"{name}_labels"] = len(samples.label_sizes_px())
    return TrainedDetector(checkpoint, content["epoch"] + 1, counts, content["precision"])
