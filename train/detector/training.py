"""How a detector learns (7.2.2)."""

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np
import torch
from lightning.pytorch import LightningModule
from torch import Tensor
from torch.optim import Optimizer
from torch.optim.lr_scheduler import LambdaLR

from data.images.datamodule import ImageDataModule
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.postprocess import postprocess_detections
from perception.evaluation.detection.average_precision import DetectionMetrics
from perception.evaluation.detection.box_rows import TrueBoxes
from perception.types import Detections
from train.detector.anchors import fit_anchors
from train.detector.losses import DetectionLoss, DetectionLossConfig, detection_loss
from train.detector.metrics import ValidationBoxes, mean_precision, measure, precision_table
from train.detector.multi_scale import (
    Interpolation,
    resize_images,
    resize_labels,
    scaled_sizes,
    size_of_batch,
)
from train.detector.networks import ANCHORS, MODEL, DetectorNetworkConfig
from train.detector.optimizer_config import OptimizerConfig
from train.detector.targets import BatchLabels
from train.networks.yolo_detector import YoloDetector

Batch = dict[str, Tensor]  # pictures, boxes_px, classes, is_ignored, numbers


@dataclass(frozen=True)
class DetectorTrainingConfig:
    """Which detector is trained, and how.

    Attributes:
        network_config: what it looks at and for.
        optimizer_config: the way down.
        loss: what it makes small.
        anchors: `auto` fits them to the training labels, `default` takes those that the network has.
        scales: smallest and largest height of the pictures trained on, over that of the form.
        seed: of their sizes and the anchors.
        training_data: what it learns from, for the model file.
        revision: of the program, for the model file.
    """

    network_config: DetectorNetworkConfig
    optimizer_config: OptimizerConfig = field(default_factory=OptimizerConfig)
    loss: DetectionLossConfig = field(default_factory=DetectionLossConfig)
    anchors: Literal["auto", "default"] = "auto"
    scales: tuple[float, float] = (0.75, 1.25)
    seed: int = 0
    training_data: str = "unknown"
    revision: str = "unknown"


class DetectorTraining(LightningModule):
    """One detector, its loss at several scales, its descent, and the figures by which it is followed."""

    def __init__(self, config: DetectorTrainingConfig, network: YoloDetector) -> None:
        """Take a network as it is."""
        super().__init__()
        self.save_hyperparameters(_hyper_parameters(config))
        self.config = config
        # Measured on a CPU with bfloat16, half the time of rows of channels.
        self.network = network.to(memory_format=torch.channels_last)
        self.sizes = scaled_sizes(config.network_config.size, *config.scales)
        self.validation_metrics: DetectionMetrics | None = None
        """What came of the last validation."""
        self._truth: TrueBoxes | None = None
        self.boxes = ValidationBoxes(config.network_config.class_names)

    @property
    def data(self) -> ImageDataModule:
        """What it learns from."""
        found: ImageDataModule = self.trainer.datamodule  # type: ignore[attr-defined]
        return found

    def on_fit_start(self) -> None:
        """Fit the anchors to the labels that are to be learned, where a training begins."""
        if self.trainer.ckpt_path is None and self.config.anchors == "auto":
            rng = np.random.default_rng(self.config.seed)
            fitted = fit_anchors(self.data.training.label_sizes_px(), ANCHORS, rng).anchors_px
            self.network.head.anchors_px.copy_(torch.from_numpy(fitted))

    def forward(self, images: Tensor) -> Tensor:
        """Return raw predictions as the network does."""
        raw: Tensor = self.network(images.contiguous(memory_format=torch.channels_last))
        return raw

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        """Return the loss of a batch, at one of the sizes."""
        network_config, step = self.config.network_config, self.trainer.global_step
        size = size_of_batch(self.sizes, step, self.config.seed)
        before = InputSize(*batch["pictures"].shape[-2:])
        images, labels = batch["pictures"].float(), _labels(batch)
        if size != before:
            how: Interpolation = "bilinear" if network_config.modality == "rgb" else "nearest"
            images = resize_images(images, size, how)
            labels = resize_labels(labels, before, size)
        seen = step * len(images) * self.trainer.world_size
        loss = self._loss(self(images), labels, seen)
        self._log_loss("train", loss, len(images))
        return loss.total

    def validation_step(self, batch: Batch, batch_idx: int) -> dict[str, list[Detections]]:
        """Judge a batch; return what is `seen` in each picture, in pixels of the input."""
        raw = self(batch["pictures"].float())
        loss = self._loss(raw, _labels(batch), self.config.loss.prior_images)
        self._log_loss("validation", loss, len(raw))
        seen = self._detections(raw, InputSize(*batch["pictures"].shape[-2:]))
        self.boxes.update(seen, batch["numbers"], self.global_rank)
        return {"seen": seen}

    def on_validation_epoch_end(self) -> None:
        """Log KITTI's measure over the validation set."""
        network_config, samples = self.config.network_config, self.data.validation
        if self._truth is None:
            self._truth = samples.truth()
        sizes_px = np.array([samples.image_size_px(row) for row in range(len(samples))])
        found = self.boxes.gathered(network_config.size, sizes_px)
        self.boxes.reset()
        self.validation_metrics = measure(
            self._truth, found, len(samples), network_config.class_names
        )
        metrics = mean_precision(self.validation_metrics)
        self.log_dict({f"validation/{name}": ap for name, ap in metrics.items()}, sync_dist=True)

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Note what the weights came to in the last validation."""
        if self.validation_metrics is not None:
            checkpoint["precision"] = precision_table(self.validation_metrics)

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - one of many forms that Lightning takes
        """Return the descent and its rate, which changes with every step."""
        optimizer = self.config.optimizer_config.make_optimizer(self.network)
        steps = int(self.trainer.estimated_stepping_batches)
        rate = LambdaLR(optimizer, self.config.optimizer_config.learning_rate_factor(steps))
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": rate, "interval": "step"}}

    def configure_gradient_clipping(
        self,
        optimizer: Optimizer,
        gradient_clip_val: float | None = None,
        gradient_clip_algorithm: str | None = None,
    ) -> None:
        """Shorten what a few odd labels would make of a step."""
        longest = self.config.optimizer_config.gradient_clip_norm
        if longest:
            self.clip_gradients(optimizer, longest, "norm")

    def _loss(self, raw: Tensor, labels: BatchLabels, images_seen: int) -> DetectionLoss:
        return detection_loss(raw, labels, self.network.head, self.config.loss, images_seen)

    def _log_loss(self, stage: str, loss: DetectionLoss, count: int) -> None:
        terms = {"loss": loss.total} | {
            f"{name}_loss": value for name, value in loss._asdict().items() if name != "total"
        }
        self.log_dict(
            {f"{stage}/{name}": value.detach() for name, value in terms.items()},
            on_step=False,
            on_epoch=True,
            batch_size=count,
            sync_dist=True,
        )

    def _detections(self, raw: Tensor, size: InputSize) -> list[Detections]:
        boxes_px, scores = (part.cpu().numpy() for part in self.network.decode(raw))
        names = self.config.network_config.class_names
        return [
            postprocess_detections(*one, names, size) for one in zip(boxes_px, scores, strict=True)
        ]


def _labels(batch: Batch) -> BatchLabels:
    return BatchLabels(batch["boxes_px"], batch["classes"], batch["is_ignored"])


def _hyper_parameters(config: DetectorTrainingConfig) -> dict[str, Any]:
    """Return what a checkpoint says of itself, in plain values."""
    parts = {name: asdict(getattr(config, name)) for name in ("descent", "loss")}
    others = {
        name: getattr(config, name)
        for name in ("anchors", "scales", "seed", "training_data", "revision")
    }
    return {"model": MODEL} | config.network_config.metadata | parts | others
