"""From labelled pictures to a trained detector, and what it comes to on those that were kept back."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal

import torch
from lightning.pytorch import Callback, Trainer
from lightning.pytorch.callbacks import WeightAveraging
from torch import Tensor

from data.images.datamodule import ImageDataModule
from perception.errors import UsageError
from train.checkpoints import read_checkpoint
from train.detector.darknet_init import init_from_darknet
from train.detector.images import DetectorImages
from train.detector.networks import MODEL, load_detector, make_detector, require_same_form
from train.detector.training import DetectorTraining, DetectorTrainingConfig
from train.networks.torchvision_detector import TorchvisionDetector, init_from_classifier
from train.networks.yolo_detector import YoloDetector
from train.networks.yolov2 import YOLOv2
from train.trainer import BEST, TrainerConfig, fit, make_trainer

MONITOR = "validation/moderate"


@dataclass(frozen=True)
class InitialWeights:
    """Where a training starts, at most one of them; without, from random weights.

    Attributes:
        checkpoint: of another training of the same network, on other pictures.
        darknet: weight file of Darknet, for yolov2: of its backbone or of a whole detector.
        backbone: state_dict of a torchvision classifier, or `download`, for a network with such a trunk.
    """

    checkpoint: Path | None = None
    darknet: Path | None = None
    backbone: Path | Literal["download"] | None = None

    def __post_init__(self) -> None:
        """Refuse several."""
        given = [name for name, value in vars(self).items() if value is not None]
        if len(given) > 1:
            raise UsageError("first weights", expected="at most one kind", found=", ".join(given))


@dataclass(frozen=True)
class TrainedDetector:
    """What a training leaves.

    Attributes:
        checkpoint: of the best epoch.
        epoch: its number, from 1.
        counts: frames and wanted labels of both parts.
        precision: average precision in percent on what was kept back, by class and overlap and by difficulty.
    """

    checkpoint: Path
    epoch: int
    counts: dict[str, int]
    precision: dict[str, dict[str, float]]


def train_detector(
    data: ImageDataModule,
    config: DetectorTrainingConfig,
    trainer_config: TrainerConfig,
    out: Path,
    resume: Path | None = None,
    first: InitialWeights = InitialWeights(),
) -> TrainedDetector | None:
    """Train; return what came of it, or None in all processes but the first, and of a trial.

    Args:
        data: labelled pictures of one modality.
        config: which network, and how it descends.
        trainer_config: how long and on what.
        out: the folder.
        resume: a checkpoint to go on from.
        first: where it starts.

    Raises:
        ModelError: a checkpoint or a weight file is damaged, or of another network.
        PerceptionError: the data cannot be read or used.
    """
    if resume is not None:
        require_same_form(resume, config.network_config)
    if first.checkpoint is not None:
        # What its numbers mean hangs on the anchors.
        config = replace(config, anchors="default")
    torch.manual_seed(trainer_config.seed)
    module = DetectorTraining(config, initial_network(config, first))
    trainer: Trainer = make_trainer(out, trainer_config, callbacks(config))
    fit(trainer, module, data, resume)
    if trainer_config.fast_dev_run or not trainer.is_global_zero:
        return None
    return _best(data, out / BEST)


def initial_network(config: DetectorTrainingConfig, first: InitialWeights) -> YoloDetector:
    """Return the network that a training starts with.

    Raises:
        ModelError: weights cannot be read, or are of another network.
        UsageError: weights of a kind that this network does not take.
    """
    network_config = config.network_config
    if first.checkpoint is not None:
        require_same_form(first.checkpoint, network_config)
        network, _ = load_detector(first.checkpoint)
        return network.train()
    network = make_detector(network_config)
    if first.darknet is not None:
        if not isinstance(network, YOLOv2):
            raise UsageError(
                "Darknet weights", expected="network yolov2", found=network_config.network
            )
        init_from_darknet(network, first.darknet)
    if first.backbone is not None:
        if not isinstance(network, TorchvisionDetector):
            raise UsageError(
                "backbone weights", expected="a trunk of torchvision", found=network_config.network
            )
        init_from_classifier(network, network_config.network, first.backbone)
    return network


def callbacks(config: DetectorTrainingConfig) -> list[Callback]:
    """Return what draws, and what averages the weights."""
    ema_decay = config.optimizer_config.ema_decay
    averages = [WeightAveraging(avg_fn=partial(_averaged, kept=ema_decay))] if ema_decay else []
    return [*averages, DetectorImages()]


def _averaged(mean: Tensor, new: Tensor, count: Tensor | int, kept: float) -> Tensor:
    """Return the running mean; at first it is short, so that the random weights are soon forgotten."""
    now = torch.as_tensor((1 + count) / (10 + count)).clamp(max=kept)
    return mean * now + new * (1 - now)


def _best(data: ImageDataModule, checkpoint: Path) -> TrainedDetector:
    content = read_checkpoint(checkpoint, MODEL)
    counts = {}
    for name, samples in (("training", data.training), ("validation", data.validation)):
        counts[f"{name}_frames"] = len(samples)
        counts[f"{name}_labels"] = len(samples.label_sizes_px())
    return TrainedDetector(checkpoint, content["epoch"] + 1, counts, content["precision"])
