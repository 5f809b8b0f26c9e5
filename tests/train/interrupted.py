"""A training that is stopped in the middle."""

from typing import Any

from lightning.pytorch import Callback, Trainer


class KilledAfter(Callback):
    """Stops a training as Ctrl-C does, in the middle of an epoch."""

    def __init__(self, step: int) -> None:
        self._step = step

    def on_train_batch_end(self, trainer: Trainer, *args: Any) -> None:
        if trainer.global_step == self._step:
            raise KeyboardInterrupt
