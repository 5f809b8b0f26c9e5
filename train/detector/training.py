"""Training of a detector (7.2.2)."""

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import torch
from lightning.pytorch import LightningModule
from torch import Tensor
from torch.optim import Optimizer

from data.results.documents import to_serializable
from data.samples.images.datamodule import ImageDataModule
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.postprocess import postprocess_detections
from perception.evaluation.detection.average_precision import DetectionMetrics
from perception.evaluation.detection.box_rows import TrueBoxes
from perception.types import Detections
from train.config import OptimizerConfig
from train.detector.anchors import fit_anchors
from train.detector.config import DETECTOR_PRESETS, Anchors, DetectionLossConfig
from train.detector.losses import DetectionLoss, detection_loss
from train.detector.metrics import ValidationBoxes, mean_precision, measure, precision_table
from train.detector.multi_scale import (
    Interpolation,
    resize_images,
    resize_labels,
    scaled_sizes,
    size_of_batch,
)
from train.detector.networks import ANCHORS, MODEL, DetectorNetworkConfig
from train.detector.targets import BatchLabels
from train.networks.yolo_detector import YoloDetector
from train.optimization import configure_optimizers

Batch = dict[str, Tensor]  # images, boxes_px, classes, is_ignored, numbers


@dataclass(frozen=True)
class DetectorTrainingConfig:
    """Network of a detector, and how it is trained.

    Attributes:
        network: Network and its input.
        optimizer: Optimizer and learning rate.
        loss: Terms of the loss.
        anchors: Anchor boxes: fitted to the training labels, or the network's own.
        scales: Smallest and largest height of the training images over that of the input.
        seed: Seed of these sizes and of the anchors.
        training_data: Names of the training drives, for the model file.
        revision: Revision of the program, for the model file.
    """

    network: DetectorNetworkConfig
    optimizer: OptimizerConfig = DETECTOR_PRESETS["default"].optimizer
    loss: DetectionLossConfig = field(default_factory=DetectionLossConfig)
    anchors: Anchors = "auto"
    scales: tuple[float, float] = (0.75, 1.25)
    seed: int = 0
    training_data: str = "unknown"
    revision: str = "unknown"


class DetectorTraining(LightningModule):
    """A detector, its loss at several scales, its optimizer and its metrics."""

    def __init__(self, config: DetectorTrainingConfig, network: YoloDetector) -> None:
        """Take a network with its initial weights."""
        super().__init__()
        self.save_hyperparameters(to_serializable(_hyper_parameters(config)))
        self.config = config
        # On a CPU with bfloat16 this takes half the time of the default layout.
        self.network = network.to(memory_format=torch.channels_last)
        self.sizes = scaled_sizes(config.network.size, *config.scales)
        self.validation_metrics: DetectionMetrics | None = None
        """Metrics of the last validation."""
        self._truth: TrueBoxes | None = None
        self.boxes = ValidationBoxes(config.network.class_names)

    @property
    def data(self) -> ImageDataModule:
        """Data module of the training."""
        found: ImageDataModule = self.trainer.datamodule  # type: ignore[attr-defined]
        return found

    def on_fit_start(self) -> None:
        """Fit the anchors to the training labels, in a new training."""
        if self.trainer.ckpt_path is None and self.config.anchors == "auto":
            rng = np.random.default_rng(self.config.seed)
            fitted = fit_anchors(self.data.training.label_sizes_px(), ANCHORS, rng).anchors_px
            self.network.head.anchors_px.copy_(torch.from_numpy(fitted))

    def forward(self, images: Tensor) -> Tensor:
        """Return raw predictions as the network does."""
        raw: Tensor = self.network(images.contiguous(memory_format=torch.channels_last))
        return raw

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        """Return the loss of a batch at one of the sizes."""
        network, step = self.config.network, self.trainer.global_step
        size = size_of_batch(self.sizes, step, self.config.seed)
        before = InputSize(*batch["images"].shape[-2:])
        images, labels = batch["images"].float(), _labels(batch)
        if size != before:
            how: Interpolation = "bilinear" if network.modality == "rgb" else "nearest"
            images = resize_images(images, size, how)
            labels = resize_labels(labels, before, size)
        seen = step * len(images) * self.trainer.world_size
        loss = self._loss(self(images), labels, seen)
        self._log_loss("train", loss, len(images))
        return loss.total

    def validation_step(self, batch: Batch, batch_idx: int) -> dict[str, list[Detections]]:
        """Evaluate a batch; return the `detections` of each image, in pixels of the input."""
        raw = self(batch["images"].float())
        loss = self._loss(raw, _labels(batch), self.config.loss.prior_images)
        self._log_loss("validation", loss, len(raw))
        detections = self._detections(raw, InputSize(*batch["images"].shape[-2:]))
        self.boxes.update(detections, batch["numbers"], self.global_rank)
        return {"detections": detections}

    def on_validation_epoch_end(self) -> None:
        """Log KITTI's average precision over the validation set."""
        network, samples = self.config.network, self.data.validation
        if self._truth is None:
            self._truth = samples.truth()
        sizes_px = np.array([samples.image_size_px(row) for row in range(len(samples))])
        found = self.boxes.gathered(network.size, sizes_px)
        self.boxes.reset()
        self.validation_metrics = measure(self._truth, found, len(samples), network.class_names)
        metrics = mean_precision(self.validation_metrics)
        self.log_dict({f"validation/{name}": ap for name, ap in metrics.items()}, sync_dist=True)

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Store the metrics of the last validation."""
        if self.validation_metrics is not None:
            checkpoint["precision"] = precision_table(self.validation_metrics)

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - one of many forms that Lightning takes
        """Return optimizer and schedule."""
        return configure_optimizers(self, self.network, self.config.optimizer)

    def configure_gradient_clipping(
        self,
        optimizer: Optimizer,
        gradient_clip_val: float | None = None,
        gradient_clip_algorithm: str | None = None,
    ) -> None:
        """Clip long gradients, which a few odd labels cause."""
        longest = self.config.optimizer.gradient_clip_norm
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
        names = self.config.network.class_names
        return [
            postprocess_detections(*one, names, size) for one in zip(boxes_px, scores, strict=True)
        ]


def _labels(batch: Batch) -> BatchLabels:
    return BatchLabels(batch["boxes_px"], batch["classes"], batch["is_ignored"])


def _hyper_parameters(config: DetectorTrainingConfig) -> dict[str, Any]:
    """Return what a checkpoint states of itself."""
    parts = {name: asdict(getattr(config, name)) for name in ("optimizer", "loss")}
    others = {
        name: getattr(config, name)
        for name in ("anchors", "scales", "seed", "training_data", "revision")
    }
    return {"model": MODEL} | config.network.metadata | parts | others
