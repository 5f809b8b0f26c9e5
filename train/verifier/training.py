"""Training of DepthCN's networks (6.1.4, 7.2.1)."""

from dataclasses import asdict
from typing import Any

from lightning.pytorch import LightningModule
from torch import Tensor
from torch.nn import functional

from train.networks.depthcn import MODEL, ThesisVerifier, make_verifier
from train.optimization import configure_optimizers
from train.verifier.config import VerifierTrainingConfig
from train.verifier.metrics import VerifierMetrics

Batch = dict[str, Tensor]  # crops, windows_px, is_vehicle, normalized_box


class VerifierTraining(LightningModule):
    """A verifier network, its loss, its optimizer and its metrics."""

    def __init__(self, config: VerifierTrainingConfig) -> None:
        """Make the network with random weights."""
        super().__init__()
        self.save_hyperparameters({"model": MODEL} | asdict(config))
        self.config = config
        self.network = make_verifier(config.method)
        self.training_metrics, self.validation_metrics = VerifierMetrics(), VerifierMetrics()

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
        logits, shares = self.network.heads(batch["crops"])
        self._loss("validation", batch, logits, shares)
        self._count(self.validation_metrics, batch, logits, shares)
        return {"logits": logits, "shares": shares}

    def on_validation_epoch_end(self) -> None:
        """Log the metrics of the validation set."""
        self._log_metrics("validation", self.validation_metrics)

    def _loss(self, stage: str, batch: Batch, logits: Tensor, shares: Tensor) -> Tensor:
        is_vehicle = batch["is_vehicle"]
        losses = {
            "class_loss": functional.binary_cross_entropy_with_logits(logits, is_vehicle.float())
        }
        if self.config.box_weight:
            has_box = is_vehicle.bool() & batch["normalized_box"].isfinite().all(1)
            losses["box_loss"] = box_loss(shares[has_box], batch["normalized_box"][has_box])
        loss = losses["class_loss"] + self.config.box_weight * losses.get("box_loss", 0.0)
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
            logits.detach(), shares.detach(), batch["is_vehicle"], batch["normalized_box"]
        )

    def _log_metrics(self, stage: str, metrics: VerifierMetrics) -> None:
        found = metrics.compute()  # over all processes already
        self.log_dict({f"{stage}/{name}": value for name, value in found.items()}, sync_dist=True)
        metrics.reset()

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - one of many forms that Lightning takes
        """Return optimizer and schedule."""
        return configure_optimizers(self, self.network, self.config.optimizer)


def box_loss(boxes: Tensor, targets: Tensor) -> Tensor:
    """Return the mean over M boxes of the errors of their edges x1 y1 x2 y2, normalized to the window.

    Squared below a tenth of the window: the gradient vanishes at the optimum, as that of an IoU does not.
    """
    if len(boxes) == 0:
        return boxes.sum()
    edges = functional.smooth_l1_loss(boxes, targets, beta=0.1, reduction="none")
    return edges.sum(1).mean()
