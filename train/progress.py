"""What a terminal shows of a training: one bar over all batches, one line an epoch."""

from typing import Any, NoReturn

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
    """Rate and time left of the whole training, on stderr."""

    def __init__(self) -> None:
        super().__init__()
        self._bar: Any = None
        self._is_enabled = True

    def disable(self) -> None:
        """Show nothing; Lightning says so in all processes but the first."""
        self._is_enabled = False

    def enable(self) -> None:
        """Show it again."""
        self._is_enabled = True

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Begin where the training begins, or goes on."""
        batches = trainer.num_training_batches
        self._bar = tqdm(
            total=int(batches * (trainer.max_epochs or 1)),
            initial=int(batches * trainer.current_epoch),
            desc="train",
            unit="batch",
            dynamic_ncols=True,
            disable=not self._is_enabled,
        )

    def on_train_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: object,
        batch: object,
        batch_idx: int,
    ) -> None:
        """Move on by a batch."""
        self._bar.update()

    def on_train_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Say what the epoch before came to: its own end is too early to know all figures."""
        self._write_line(trainer)

    def on_train_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Say what the last epoch came to, and close the bar."""
        self._write_line(trainer)
        self._close()

    def _write_line(self, trainer: Trainer) -> None:
        stages = (_line(trainer.callback_metrics, stage) for stage in ("train", "validation"))
        words = [f"epoch {trainer.current_epoch}/{trainer.max_epochs}", *filter(None, stages)]
        if self._is_enabled and len(words) > 1:
            self._bar.write("   ".join(words), file=self._bar.fp)

    def on_exception(
        self, trainer: Trainer, pl_module: LightningModule, exception: BaseException
    ) -> None:
        """Leave the terminal in order."""
        self._close()

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.close()


def step_bar(most: int, first: int = 0) -> "tqdm[NoReturn]":
    """Return a bar over the steps of a training that may end before the last, on stderr."""
    return tqdm(total=most, initial=first, desc="train", unit="step", dynamic_ncols=True)


def _line(metrics: dict[str, Any], stage: str) -> str:
    shown = [
        f"{name} {float(metrics[f'{stage}/{name}']):.4f}"
        for name in _SHOWN
        if f"{stage}/{name}" in metrics
    ]
    return f"{stage} {' '.join(shown)}" if shown else ""
