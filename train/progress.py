"""Progress of a training in the terminal: a bar, and a line for each epoch."""

from typing import Any

from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import ProgressBar
from tqdm import tqdm

_SHOWN = (  # where they are logged
    "loss",
    "accuracy",
    "precision",
    "recall",
    "box_iou",
    "easy",
    "moderate",
    "hard",
    "moderate_50",
)


class TrainingBar(ProgressBar):
    """Rate and remaining time of the whole training, on stderr."""

    def __init__(self) -> None:
        super().__init__()
        self._bar: Any = None
        self._is_enabled = True

    def disable(self) -> None:
        """Show nothing; called by Lightning in all processes but the first."""
        self._is_enabled = False

    def enable(self) -> None:
        """Show it again."""
        self._is_enabled = True

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Start the bar where the training starts or resumes."""
        batches, steps = int(trainer.num_training_batches), trainer.max_steps
        by_steps = steps * trainer.accumulate_grad_batches
        by_epochs = batches * (trainer.max_epochs or 1)
        self._bar = tqdm(
            # Where there is no limit, it is -1 epochs or steps.
            total=min((count for count in (by_epochs, by_steps) if count >= 0), default=None),
            initial=batches * trainer.current_epoch,
            desc="train",
            unit="batch",
            dynamic_ncols=True,
            disable=not self._is_enabled,
        )

    def on_train_batch_end(self, trainer: Trainer, *_: object, **__: object) -> None:
        """Advance by a batch."""
        self._bar.update()

    def on_train_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Write the metrics of the epoch before; at its own end not all are known."""
        self._write_line(trainer)

    def on_train_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Write the metrics of the last epoch, and close the bar."""
        self._write_line(trainer)
        self._close()

    def _write_line(self, trainer: Trainer) -> None:
        stages = (_line(trainer.callback_metrics, stage) for stage in ("train", "validation"))
        words = [_progress(trainer), *filter(None, stages)]
        if self._is_enabled and len(words) > 1:
            self._bar.write("   ".join(words), file=self._bar.fp)

    def on_exception(self, *_: object) -> None:
        """Close the bar."""
        self._close()

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.close()


def _progress(trainer: Trainer) -> str:
    """Return the epoch of all, or where steps end the training, the step of all."""
    if (trainer.max_epochs or 0) > 0:
        return f"epoch {trainer.current_epoch}/{trainer.max_epochs}"
    return f"epoch {trainer.current_epoch}, step {trainer.global_step}/{trainer.max_steps}"


def _line(metrics: dict[str, Any], stage: str) -> str:
    shown = [
        f"{name} {float(metrics[f'{stage}/{name}']):.4f}"
        for name in _SHOWN
        if f"{stage}/{name}" in metrics
    ]
    return f"{stage} {' '.join(shown)}" if shown else ""
