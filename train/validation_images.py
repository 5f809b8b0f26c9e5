"""TensorBoard images of the same samples in every validation."""

import numpy as np
from lightning.pytorch import Callback, LightningModule, Trainer

from perception.types import UInt8
from train.events import tensorboard_loggers


class ValidationImages(Callback):
    """Chooses samples of the validation data, and logs what is drawn of them.

    Attributes:
        name: Name of the image in TensorBoard.
        count: Number of samples that are shown.
        axis: Axis along which they are joined: 0 below each other, 1 beside each other.
    """

    name: str
    count: int
    axis: int

    def __init__(self) -> None:
        self._rows: frozenset[int] = frozenset()
        self._drawn: dict[int, UInt8] = {}

    def on_validation_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Choose the samples: spread evenly, the same in every epoch."""
        count = len(trainer.datamodule.validation)  # type: ignore[attr-defined]
        rows = np.linspace(0, count - 1, min(count, self.count)).round().astype(int)
        is_shown = bool(tensorboard_loggers(trainer))
        self._rows, self._drawn = frozenset(rows.tolist() if is_shown else ()), {}

    def on_validation_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Log the drawn samples as one image."""
        for logger in tensorboard_loggers(trainer):
            if self._drawn:
                drawn = [self._drawn[row] for row in sorted(self._drawn)]
                logger.experiment.add_image(
                    self.name,
                    np.concatenate(drawn, axis=self.axis),
                    trainer.global_step,
                    dataformats="HWC",
                )
