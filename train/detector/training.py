"""Training of a detector (7.2.2)."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, ClassVar

import numpy as np
import torch
from lightning.pytorch import Callback, LightningModule
from lightning.pytorch.cli import LRSchedulerCallable, OptimizerCallable
from torch import Tensor
from torch.optim import AdamW

from data.samples.images.datamodule import ImageDataModule
from data.samples.images.dataset import ImageDataset
from data.splits.training_frames import ENTRY, UNKNOWN
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.postprocess import postprocess_detections
from perception.errors import UsageError
from perception.evaluation.detection.average_precision import DetectionMetrics
from perception.evaluation.detection.box_rows import TrueBoxes
from perception.types import Detections, Fit, MapFilling, Modality
from train.best_epoch import Criterion, Ranking
from train.checkpoints import program_revision
from train.detector.anchor_free_loss import anchor_free_loss
from train.detector.anchors import fit_anchors
from train.detector.config import (
    Anchors,
    DetectionLossConfig,
    DistillationConfig,
    InitialWeights,
)
from train.detector.distillation import Distillation
from train.detector.images import DetectorImages
from train.detector.initial_network import initial_network
from train.detector.losses import DetectionLoss, detection_loss
from train.detector.metrics import ValidationBoxes, mean_precision, measure, precision_table
from train.detector.multi_scale import (
    Interpolation,
    resize_images,
    resize_labels,
    scaled_sizes,
    size_of_batch,
)
from train.detector.networks import ANCHORS, IDENTITY, MODEL, DetectorNetworkConfig
from train.detector.targets import BatchLabels
from train.events import log_loss
from train.networks.yolo_head import DetectionHead, YoloHead
from train.networks.yolox import YoloxHead
from train.optimization import WarmupCosine, configure_optimizers

_LOSS, _RANDOM_WEIGHTS = DetectionLossConfig(), InitialWeights()
_NO_DISTILLATION = DistillationConfig()

Batch = dict[str, Tensor]  # images, boxes_px, classes, is_ignored, numbers
# From raw predictions, labels, head, weights of the terms and the number of images seen before.
HeadLoss = Callable[[Any, BatchLabels, Any, DetectionLossConfig, int], DetectionLoss]
_LOSSES: Mapping[type[DetectionHead[Any]], HeadLoss] = {
    YoloHead: detection_loss,
    YoloxHead: anchor_free_loss,
}


class DetectorTraining(LightningModule):
    """A detector, its loss at several scales, its optimizer and its metrics.

    Attributes:
        ranking: Criteria of the best epoch; average precision at KITTI's overlap is 0 in the first epochs.
        identity: Hyperparameters that a checkpoint must share to be resumed.
    """

    ranking: ClassVar[Ranking] = (
        Criterion("validation/moderate"),
        Criterion("validation/moderate_50"),
        Criterion("validation/loss", is_lower_better=True),
    )
    identity: ClassVar[tuple[str, ...]] = IDENTITY

    def __init__(  # noqa: PLR0913 - the flags of a group
        self,
        *,
        modality: Modality,
        network: str = "compact",
        classes: tuple[str, ...] = ("Car",),
        size: str = "192x640",
        filling: MapFilling = "default",
        jpeg_quality: int | None = None,
        fit: Fit = "letterbox",
        anchors: Anchors = "auto",
        scales: tuple[float, float] = (0.75, 1.25),
        loss: DetectionLossConfig = _LOSS,
        weights: InitialWeights = _RANDOM_WEIGHTS,
        distillation: DistillationConfig = _NO_DISTILLATION,
        seed: int = 0,
        optimizer: OptimizerCallable = lambda weights: AdamW(weights, lr=0.002, weight_decay=0.02),
        lr_scheduler: LRSchedulerCallable | None = WarmupCosine,
    ) -> None:
        """Make the network with its initial weights.

        Args:
            modality: Camera image, rgb; depth map, dm; or reflectance map, rm.
            network: Network: compact, the one that ships for maps; yolox-nano, the one that ships for images; yolov2;
                or the torchvision classifier of its backbone, such as resnet18.
            classes: Classes to detect, as labels spell them.
            size: Height and width of the input, multiples of 32; the thesis' is 416x416.
            filling: Method by which maps are made dense: default, thesis, nearest, linear, natural; or sparse, the
                returns alone (Table B.2).
            jpeg_quality: Quality of the JPEG compression of the input, 1 to 100; 75 in the thesis (7.2.2).
            fit: Letterbox, which keeps the aspect of images, or stretch, as the thesis does.
            anchors: Anchor boxes: auto fits them to the training labels; default takes the network's own, as with
                the weights of a whole Darknet detector. A training that starts from a checkpoint keeps its own.
            scales: Smallest and largest height of the training images over that of the input.
            loss: Terms of the loss.
            weights: Initial weights.
            distillation: What is kept of the initial weights.
            seed: Seed of anchors and sizes.
            optimizer: Optimizer of the weights.
            lr_scheduler: Schedule of the learning rate.

        Raises:
            ModelError: initial weights cannot be read, or are of another network.
            UsageError: there is no such network or input, or it takes no weights of this kind.
        """
        super().__init__()
        if distillation.weight and not weights.given:
            raise UsageError(
                "--model.distillation.weight",
                expected="initial weights that know something, such as --model.weights.public",
                found="random ones",
            )
        self.image = DetectorNetworkConfig(
            modality, tuple(classes), InputSize.parse(size), filling, jpeg_quality, fit, network
        )
        """Input of the network, which the data module makes."""
        stated = {"scales": list(scales), "seed": seed, "loss": asdict(loss)}
        stated |= {"distillation": asdict(distillation)}
        self.save_hyperparameters(
            {"model": MODEL, **self.image.metadata, **stated, "anchors": anchors}
            | {"training_data": "unknown", "revision": program_revision()}
        )
        self.loss_config, self.seed = loss, seed
        self.optimizer, self.lr_scheduler = optimizer, lr_scheduler
        # The meaning of a checkpoint's weights depends on its anchors.
        made, learned = initial_network(self.image, weights)
        has_anchors = len(made.head.anchors_px) > 0
        self.fits_anchors = has_anchors and anchors == "auto" and weights.checkpoint is None
        # On a CPU with bfloat16 this takes half the time of the default layout.
        self.network = made.to(memory_format=torch.channels_last)
        if weights.checkpoint is not None:
            # The data module adds the frames of this training.
            self.hparams.update({ENTRY: learned.get(ENTRY, UNKNOWN)})
        self._distillation = Distillation(self.network, distillation)
        scaled_sizes(self.image.size, *scales)  # which validates them
        self.scales = scales
        self.metrics: DetectionMetrics | None = None
        """Metrics of the last validation or test."""
        self._truths: dict[str, TrueBoxes] = {}
        self.boxes = ValidationBoxes(self.image.class_names)

    @property
    def data(self) -> ImageDataModule:
        """Data module of the training."""
        found: ImageDataModule = self.trainer.datamodule  # type: ignore[attr-defined]
        return found

    def configure_callbacks(self) -> list[Callback]:
        """Return the callback that draws images."""
        return [DetectorImages()]

    def on_fit_start(self) -> None:
        """Fit the anchors to the training labels, in a new training."""
        if self.trainer.ckpt_path is None and self.fits_anchors:
            rng = np.random.default_rng(self.seed)
            fitted = fit_anchors(self.data.training.label_sizes_px(), ANCHORS, rng).anchors_px
            self.network.head.anchors_px.copy_(torch.from_numpy(fitted))

    def forward(self, images: Tensor) -> Any:  # noqa: ANN401 - as the head makes them
        """Return raw predictions as the network does."""
        return self.network(images.contiguous(memory_format=torch.channels_last))

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        """Return the loss of a batch at one of the sizes."""
        trainer, step = self.trainer, self.trainer.global_step
        before = InputSize(*batch["images"].shape[-2:])  # which may be a crop
        size = size_of_batch(scaled_sizes(before, *self.scales), step, self.seed)
        images, labels = batch["images"].float(), _labels(batch)
        if size != before:
            how: Interpolation = "bilinear" if self.image.modality == "rgb" else "nearest"
            images = resize_images(images, size, how)
            labels = resize_labels(labels, before, size)
        seen = step * len(images) * trainer.world_size * trainer.accumulate_grad_batches
        raw = self(images)
        kept = self._distillation.loss(images, self.network.decode(raw), labels)
        loss = self._loss(raw, labels, seen).with_distillation(kept)
        log_loss(self, "train", loss, len(images))
        return loss.total

    def validation_step(self, batch: Batch, batch_idx: int) -> dict[str, list[Detections]]:
        """Evaluate a batch; return the `detections` of each image, in pixels of the input."""
        return self._evaluate("validation", batch)

    def on_validation_epoch_end(self) -> None:
        """Log KITTI's average precision over the validation part."""
        self._log_precision("validation", self.data.validation)

    def test_step(self, batch: Batch, batch_idx: int) -> dict[str, list[Detections]]:
        """Evaluate a batch."""
        return self._evaluate("test", batch)

    def on_test_epoch_end(self) -> None:
        """Log KITTI's average precision over the test part."""
        assert self.data.test is not None  # whose batches have been evaluated
        self._log_precision("test", self.data.test)

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Store the metrics of the last validation."""
        if self.metrics is not None:
            checkpoint["precision"] = precision_table(self.metrics)

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - one of many forms that Lightning takes
        """Return optimizer and schedule."""
        return configure_optimizers(self, self.network, self.optimizer, self.lr_scheduler)

    def _evaluate(self, stage: str, batch: Batch) -> dict[str, list[Detections]]:
        raw = self(batch["images"].float())
        loss = self._loss(raw, _labels(batch), self.loss_config.prior_images)
        log_loss(self, stage, loss, len(batch["images"]))
        detections = self._detections(raw, InputSize(*batch["images"].shape[-2:]))
        self.boxes.update(detections, batch["numbers"], self.global_rank)
        return {"detections": detections}

    def _log_precision(self, stage: str, samples: ImageDataset) -> None:
        if stage not in self._truths:
            self._truths[stage] = samples.truth()
        names = self.image.class_names
        placements = [samples.placement(row) for row in range(len(samples))]
        found = self.boxes.gathered(placements)
        self.boxes.reset()
        self.metrics = measure(self._truths[stage], found, len(samples), names)
        metrics = mean_precision(self.metrics)
        self.log_dict({f"{stage}/{name}": ap for name, ap in metrics.items()}, sync_dist=True)

    def _loss(self, raw: Any, labels: BatchLabels, images_seen: int) -> DetectionLoss:  # noqa: ANN401
        head = self.network.head
        return head_loss(head)(raw, labels, head, self.loss_config, images_seen)

    def _detections(self, raw: Any, size: InputSize) -> list[Detections]:  # noqa: ANN401
        boxes_px, scores = (part.cpu().numpy() for part in self.network.decode(raw))
        names = self.image.class_names
        return [
            postprocess_detections(*one, names, size) for one in zip(boxes_px, scores, strict=True)
        ]


def _labels(batch: Batch) -> BatchLabels:
    return BatchLabels(batch["boxes_px"], batch["classes"], batch["is_ignored"])


def head_loss(head: DetectionHead[Any]) -> HeadLoss:
    """Return the loss that the predictions of a head are trained by."""
    return _LOSSES[type(head)]
