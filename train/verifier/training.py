"""How the networks of DepthCN learn (6.1.4)."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, Literal

from lightning.pytorch import LightningModule
from torch import Tensor
from torch.nn import functional
from torch.optim import SGD
from torch.optim.lr_scheduler import LambdaLR

from perception.types import Method
from train.networks.depthcn import MODEL, ThesisVerifier, make_verifier
from train.schedules import step_decay, warmup_cosine
from train.verifier.loss import box_loss
from train.verifier.metrics import VerifierMetrics

Batch = dict[str, Tensor]  # crops, windows_px, is_vehicle, normalized_box


@dataclass(frozen=True)
class VerifierTrainingConfig:
    """How a network is trained, by stochastic gradient descent.

    Attributes:
        method: which network.
        learning_rate: the highest.
        schedule: `stepped` a tenth every 8 epochs, `cosine` a short rise and a long fall.
        weight_decay: L2, of weights only.
        momentum: of the descent.
        box_weight: of the boxes' loss beside that of the classes.
        training_data: what it learns from, for the model file.
        revision: of the program, for the model file.
    """

    method: Method = "default"
    learning_rate: float = 0.05
    schedule: Literal["stepped", "cosine"] = "cosine"
    weight_decay: float = 0.0005
    momentum: float = 0.9
    box_weight: float = 1.0
    training_data: str = "unknown"
    revision: str = "unknown"


# The thesis' own figures: 7.2.1, the rate and its steps and L2 from the author's code.
VERIFIER_CONFIGS: dict[Method, VerifierTrainingConfig] = {
    "default": VerifierTrainingConfig(),
    "thesis": VerifierTrainingConfig(
        "thesis", 0.001, "stepped", weight_decay=0.004, box_weight=0.0
    ),
}
_EPOCHS_A_STAGE = 8


class VerifierTraining(LightningModule):
    """One network, its loss, its descent, and the figures by which it is followed."""

    def __init__(self, config: VerifierTrainingConfig) -> None:
        """Make the network anew."""
        super().__init__()
        self.save_hyperparameters({"model": MODEL} | asdict(config))
        self.config = config
        self.network = make_verifier(config.method)
        self.training_metrics, self.validation_metrics = VerifierMetrics(), VerifierMetrics()

    def on_fit_start(self) -> None:
        """Tell the thesis' network what to subtract: the mean of what it will be trained on."""
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
        """Log the figures over the epoch, measured while it learned."""
        self._log_metrics("train", self.training_metrics)

    def validation_step(self, batch: Batch, batch_idx: int) -> dict[str, Tensor]:
        """Judge a batch; return logits and shares for whoever draws them."""
        logits, shares = self.network.heads(batch["crops"])
        self._loss("validation", batch, logits, shares)
        self._count(self.validation_metrics, batch, logits, shares)
        return {"logits": logits, "shares": shares}

    def on_validation_epoch_end(self) -> None:
        """Log the figures over the validation set."""
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
        """Return the descent and its rate, which changes with every step."""
        kept = [weight for weight in self.parameters() if weight.ndim > 1]
        free = [weight for weight in self.parameters() if weight.ndim <= 1]
        groups = [
            {"params": kept, "weight_decay": self.config.weight_decay},
            {"params": free, "weight_decay": 0.0},
        ]
        optimizer = SGD(groups, lr=self.config.learning_rate, momentum=self.config.momentum)
        rate = LambdaLR(optimizer, self._rate())
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": rate, "interval": "step"}}

    def _rate(self) -> Callable[[int], float]:
        steps = int(self.trainer.estimated_stepping_batches)
        if self.config.schedule == "stepped":
            epochs = self.trainer.max_epochs or 1
            return partial(step_decay, steps_per_stage=_EPOCHS_A_STAGE * max(steps // epochs, 1))
        return partial(warmup_cosine, steps=steps)
