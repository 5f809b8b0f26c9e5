"""The best epoch of a training: one order of metrics for its checkpoint and for early stopping."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import Checkpoint

from perception.errors import UsageError
from train.events import log_hyperparameters, tensorboard_loggers
from train.folder import TrainingFolder


@dataclass(frozen=True)
class Criterion:
    """A logged metric by which epochs are compared.

    Attributes:
        metric: Name under which it is logged.
        is_lower_better: Whether the epoch of the lower value is the better one.
    """

    metric: str
    is_lower_better: bool = False

    def worth(self, metrics: Mapping[str, float]) -> float:
        """Return the value, negative where a lower one is better; what is not finite is worst."""
        value = metrics[self.metric]
        return (-value if self.is_lower_better else value) if math.isfinite(value) else -math.inf


Ranking = tuple[Criterion, ...]
"""Criteria of the best epoch; each decides where those before it are equal."""


class BestEpoch(Checkpoint):
    """Write last.ckpt after each epoch and best.ckpt after the best; stop after some epochs without a better one.

    Epochs are compared by the `ranking` of the module, and written into the trainer's `default_root_dir`. The best
    epoch's metrics are logged with the hyperparameters, for TensorBoard's table of all trainings.
    """

    def __init__(self, patience: int | None = None) -> None:
        """Take the patience.

        Args:
            patience: Epochs without a better one after which training stops; else it runs to the end.
        """
        if patience is not None and patience < 1:
            where = "--early_stopping.patience"
            raise UsageError(where, expected="at least one epoch", found=str(patience))
        self._patience = patience
        self._best: dict[str, float] = {}
        self._epochs_without_better = 0

    def on_train_batch_end(self, trainer: Trainer, *_: object, **__: object) -> None:
        """Stop after the last step as after an early one: with a validation."""
        if 0 < trainer.max_steps <= trainer.global_step:
            trainer.should_stop = True

    def on_train_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Compare the epoch with the best one, and write its checkpoints."""
        if trainer.fast_dev_run:  # type: ignore[attr-defined]
            return
        folder, ranking = TrainingFolder(Path(trainer.default_root_dir)), ranking_of(pl_module)
        if (trainer.current_epoch + 1) % (trainer.check_val_every_n_epoch or 1):
            trainer.save_checkpoint(folder.last)
            return
        logged = trainer.callback_metrics
        metrics = {one.metric: float(logged[one.metric]) for one in ranking}
        is_best = not self._best or _worth(ranking, metrics) > _worth(ranking, self._best)
        self._best = metrics if is_best else self._best
        self._epochs_without_better = 0 if is_best else self._epochs_without_better + 1
        if is_best:
            trainer.save_checkpoint(folder.best)
        trainer.save_checkpoint(folder.last)
        if self._patience is not None and self._epochs_without_better >= self._patience:
            trainer.should_stop = True

    def on_train_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Log hyperparameters and metrics of the best epoch."""
        for logger in tensorboard_loggers(trainer):
            if self._best:
                log_hyperparameters(logger, dict(pl_module.hparams), self._best)

    def on_exception(self, trainer: Trainer, pl_module: LightningModule, *_: object) -> None:
        """Log them of what was trained until then."""
        self.on_train_end(trainer, pl_module)

    def state_dict(self) -> dict[str, Any]:
        """Return the state that a checkpoint keeps."""
        return {"best": self._best, "epochs_without_better": self._epochs_without_better}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Take the state of a checkpoint."""
        self._best = state_dict["best"]
        self._epochs_without_better = state_dict["epochs_without_better"]


def ranking_of(module: LightningModule) -> Ranking:
    """Return the criteria by which a module's epochs are compared."""
    ranking: Ranking = module.ranking  # type: ignore[assignment]
    return ranking


def _worth(ranking: Ranking, metrics: Mapping[str, float]) -> tuple[float, ...]:
    return tuple(one.worth(metrics) for one in ranking)
