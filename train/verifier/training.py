"""Training of DepthCN's networks (6.1.4, 7.2.1)."""

from collections.abc import Mapping
from typing import Any, ClassVar

import torch
from lightning.pytorch import Callback, LightningModule
from lightning.pytorch.cli import LRSchedulerCallable, OptimizerCallable
from torch import Tensor
from torch.nn import functional
from torch.optim import SGD

from data.samples.crops.datamodule import CropDataModule
from data.samples.crops.labelled_frames import CropConfig
from data.samples.crops.previews import augmentation_previews, preview_rows
from perception.types import Method, UInt8
from train.best_epoch import Criterion, Ranking
from train.checkpoints import program_revision
from train.networks.depthcn import (
    MODEL,
    VERIFIER_INPUTS,
    ThesisVerifier,
    make_verifier,
    object_logits,
)
from train.optimization import WarmupCosine, configure_optimizers
from train.verifier.images import VerifierImages
from train.verifier.metrics import VerifierMetrics

Batch = dict[str, Tensor]  # crops, windows_px, is_vehicle, normalized_box
_SHOWN_SAMPLES = 8


class VerifierTraining(LightningModule):
    """A verifier network, its loss, its optimizer and its metrics.

    Attributes:
        ranking: Criteria of the best epoch.
        identity: Hyperparameters that a checkpoint must share to be resumed.
    """

    ranking: ClassVar[Ranking] = (
        Criterion("validation/balanced_accuracy"),
        Criterion("validation/loss", is_lower_better=True),
    )
    identity: ClassVar[tuple[str, ...]] = ("method", "classes")

    def __init__(  # noqa: PLR0913 - the flags of a group
        self,
        *,
        method: Method = "default",
        classes: tuple[str, ...] = ("Car",),
        dropout: float | None = None,
        box_weight: float = 1.0,
        seed: int = 0,
        optimizer: OptimizerCallable = lambda weights: SGD(
            weights, lr=0.05, momentum=0.9, weight_decay=0.0005
        ),
        lr_scheduler: LRSchedulerCallable | None = WarmupCosine,
    ) -> None:
        """Make the network with random weights.

        Args:
            method: Network and its input: default, the one that ships; or thesis, that of Fig. 6.5.
            classes: Classes to tell apart, as labels spell them; Car alone of the thesis.
            dropout: Fraction of the units that are dropped before the last layer in training; else the network's own.
            box_weight: Weight of the loss of boxes beside that of classes.
            seed: Seed of the training, for the checkpoint.
            optimizer: Optimizer of the weights.
            lr_scheduler: Schedule of the learning rate.
        """
        super().__init__()
        self.save_hyperparameters(
            {
                "model": MODEL,
                "method": method,
                "classes": list(classes),
                "dropout": dropout,
                "box_weight": box_weight,
                "seed": seed,
                "training_data": "unknown",
                "revision": program_revision(),
            }
        )
        self.box_weight, self.optimizer, self.lr_scheduler = box_weight, optimizer, lr_scheduler
        self.network = make_verifier(method, dropout, len(classes))
        inputs = VERIFIER_INPUTS[method]
        self.crop = CropConfig(
            method, window=inputs.window, channels=inputs.channels, classes=tuple(classes)
        )
        """Input of the network, which the data module makes."""
        self.training_metrics, self.evaluation_metrics = VerifierMetrics(), VerifierMetrics()
        self.metrics: dict[str, float] = {}
        """Metrics of the last validation or test."""

    def configure_callbacks(self) -> list[Callback]:
        """Return the callback that draws crops."""
        return [VerifierImages(lambda: augmentation_images(self.trainer.datamodule))]  # type: ignore[attr-defined]

    def on_fit_start(self) -> None:
        """Set the mean crop that the thesis' network subtracts, in a new training."""
        is_new = self.trainer.ckpt_path is None
        if is_new and isinstance(self.network, ThesisVerifier):
            mean = self.trainer.datamodule.mean_crop()  # type: ignore[attr-defined]
            self.network.mean_image.copy_(mean)

    def forward(self, crops: Tensor, windows_px: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits and boxes as the network does."""
        logits, boxes_px = self.network(crops, windows_px)
        return logits, boxes_px

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        """Return the loss of a batch."""
        logits, shares = self.network.heads(batch["crops"])
        loss = self._loss("train", batch, logits, shares)
        self._count(self.training_metrics, batch, logits, shares)
        return loss

    def on_train_epoch_end(self) -> None:
        """Log the metrics of the epoch, measured during training."""
        self._log_metrics("train", self.training_metrics)

    def validation_step(self, batch: Batch, batch_idx: int) -> dict[str, Tensor]:
        """Evaluate a batch; return logits and boxes for the callback that draws them."""
        return self._evaluate("validation", batch)

    def on_validation_epoch_end(self) -> None:
        """Log the metrics of the validation part."""
        self.metrics = self._log_metrics("validation", self.evaluation_metrics)

    def test_step(self, batch: Batch, batch_idx: int) -> dict[str, Tensor]:
        """Evaluate a batch."""
        return self._evaluate("test", batch)

    def on_test_epoch_end(self) -> None:
        """Log the metrics of the test part."""
        self.metrics = self._log_metrics("test", self.evaluation_metrics)

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - one of many forms that Lightning takes
        """Return optimizer and schedule."""
        return configure_optimizers(self, self.network, self.optimizer, self.lr_scheduler)

    def _evaluate(self, stage: str, batch: Batch) -> dict[str, Tensor]:
        logits, shares = self.network.heads(batch["crops"])
        self._loss(stage, batch, logits, shares)
        self._count(self.evaluation_metrics, batch, logits, shares)
        return {"logits": object_logits(logits), "shares": shares}

    def _loss(self, stage: str, batch: Batch, logits: Tensor, shares: Tensor) -> Tensor:
        is_vehicle = batch["is_vehicle"]
        losses = {
            "class_loss": functional.binary_cross_entropy_with_logits(
                logits, class_targets(logits, batch)
            )
        }
        if self.box_weight:
            has_box = is_vehicle.bool() & batch["normalized_box"].isfinite().all(1)
            losses["box_loss"] = box_loss(shares[has_box], batch["normalized_box"][has_box])
        loss = losses["class_loss"] + self.box_weight * losses.get("box_loss", 0.0)
        named = {f"{stage}/{name}": value for name, value in {"loss": loss, **losses}.items()}
        self.log_dict(
            named,
            on_step=False,
            on_epoch=True,
            batch_size=len(logits),
            sync_dist=True,
        )
        return loss

    def _count(
        self, metrics: VerifierMetrics, batch: Batch, logits: Tensor, shares: Tensor
    ) -> None:
        metrics.update(
            object_logits(logits).detach(),
            shares.detach(),
            batch["is_vehicle"],
            batch["normalized_box"],
        )

    def _log_metrics(self, stage: str, metrics: VerifierMetrics) -> dict[str, float]:
        found = metrics.compute()  # over all processes already
        self.log_dict({f"{stage}/{name}": value for name, value in found.items()}, sync_dist=True)
        metrics.reset()
        return {name: float(value) for name, value in found.items()}


def class_targets(logits: Tensor, batch: Batch) -> Tensor:
    """Return the targets of (M,) logits of a vehicle or of (M, C) logits of several classes, 0 or 1."""
    if logits.ndim == 1:
        return batch["is_vehicle"].float()
    numbers = torch.arange(logits.shape[1], device=logits.device)
    return (batch["classes"][:, None] == numbers).float()


def augmentation_images(data: CropDataModule) -> Mapping[str, UInt8]:
    """Return images of what each augmentation does."""
    if data.augmentation is None:
        return {}
    rows = preview_rows(data.training, _SHOWN_SAMPLES)
    return augmentation_previews(data.training, data.augmentation, rows)


def box_loss(boxes: Tensor, targets: Tensor) -> Tensor:
    """Return the mean over M boxes of the errors of their edges x1 y1 x2 y2, normalized to the window.

    Squared below a tenth of the window: the gradient vanishes at the optimum, as that of an IoU does not.
    """
    if len(boxes) == 0:
        return boxes.sum()
    edges = functional.smooth_l1_loss(boxes, targets, beta=0.1, reduction="none")
    return edges.sum(1).mean()
