"""TensorBoard events: speed, memory and gradients of a training, and logged values read back."""

import resource
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol

import numpy as np
import torch
from lightning.pytorch import Callback, LightningModule, Trainer
from lightning.pytorch.loggers import TensorBoardLogger
from lightning.pytorch.utilities.data import extract_batch_size
from torch import Tensor
from torch.nn.utils import get_total_norm
from torch.optim import Optimizer

from data.report.training_report import read_all_scalars
from data.splits.training_frames import ENTRY
from perception.atomic_file import write_error
from perception.types import Float64


class Loss(Protocol):
    """Named terms of a loss, and their total."""

    @property
    def total(self) -> Tensor:
        """Sum of the terms."""
        ...

    def _asdict(self) -> dict[str, Tensor]: ...


class TrainingStatistics(Callback):
    """Log, for each epoch, what the training costs.

    speed/samples_per_s    images, crops or combinations per second, of all processes, without validation
    memory/process_gb      most memory that the process has held so far, in GB of 10^9 bytes
    memory/gpu_gb          most memory of tensors on the GPU so far
    train/gradient_norm    mean norm of the gradient over all steps, before it is clipped
    """

    def __init__(self) -> None:
        self._samples, self._start_s, self._end_s = 0, 0.0, 0.0

    def on_train_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Start the clock."""
        self._samples, self._start_s = 0, perf_counter()

    def on_before_optimizer_step(
        self, trainer: Trainer, pl_module: LightningModule, optimizer: Optimizer
    ) -> None:
        """Log the norm of the gradient of a step."""
        gradients = [one.grad for one in pl_module.parameters() if one.grad is not None]
        norm = get_total_norm(gradients)
        pl_module.log(
            "train/gradient_norm", norm, on_step=False, on_epoch=True, batch_size=1, sync_dist=True
        )

    def on_train_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: object,
        batch: Any,  # noqa: ANN401 - of any data module
        batch_idx: int,
    ) -> None:
        """Count a batch."""
        self._samples += extract_batch_size(batch) * trainer.world_size
        self._end_s = perf_counter()

    def on_train_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Log the epoch's speed and memory."""
        found = {
            "speed/samples_per_s": self._samples / max(self._end_s - self._start_s, 1e-9),
            "memory/process_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9,
        }
        if pl_module.device.type == "cuda":
            found["memory/gpu_gb"] = torch.cuda.max_memory_allocated(pl_module.device) / 1e9
        for logger in trainer.loggers:
            logger.log_metrics(found, trainer.global_step)


def event_logger(folder: Path) -> TensorBoardLogger:
    """Return the logger of the events in a folder."""
    return TensorBoardLogger(folder, name="", version="", default_hp_metric=False)


def tensorboard_loggers(trainer: Trainer) -> list[TensorBoardLogger]:
    """Return the loggers that show images; only the first process has any, and none where logging is off."""
    loggers = trainer.loggers if trainer.is_global_zero else []
    return [logger for logger in loggers if isinstance(logger, TensorBoardLogger)]


@contextmanager
def writing_events(folder: Path) -> Iterator[None]:
    """Name the folder where its events cannot be written, without the traceback of the writer's thread.

    Raises:
        WriteError: the disk is full, or the folder cannot be written to.
    """
    hook = threading.excepthook
    threading.excepthook = lambda error: (
        None if issubclass(error.exc_type, OSError) else hook(error)
    )
    try:
        yield
    except (OSError, ValueError) as error:
        # The logger reports what cannot be written as a value that is not supported.
        cause = error if isinstance(error, OSError) else error.__cause__
        if not isinstance(cause, OSError):
            raise
        raise write_error(folder, cause) from error
    finally:
        threading.excepthook = hook


def log_hyperparameters(
    logger: TensorBoardLogger, hyperparameters: dict[str, Any], best: Mapping[str, float]
) -> None:
    """Log a row of TensorBoard's HPARAMS table: hyperparameters, and metrics of the best epoch or step."""
    metrics = {f"best/{name}": value for name, value in best.items()}
    shown = {name: value for name, value in hyperparameters.items() if name != ENTRY}
    logger.log_hyperparams(shown, metrics)


def read_scalars(folder: Path, names: Sequence[str]) -> dict[str, Float64]:
    """Return the logged values of each name in the order of their steps, from TensorBoard's files.

    Of a step that was logged twice, as by a training that was killed and resumed, the later one counts.
    """
    logged = read_all_scalars(folder)
    by_step = {name: sorted(logged.get(name, {}).items()) for name in names}
    return {name: np.array([one for _, one in rows]) for name, rows in by_step.items()}


def log_loss(module: LightningModule, stage: str, loss: Loss, count: int) -> None:
    """Log the terms of a batch's loss, averaged over the epoch.

    Args:
        module: Training that logs.
        stage: Part of the data: train, validation or test.
        loss: Terms of the loss.
        count: Number of samples of the batch.
    """
    terms = {"loss": loss.total} | {
        f"{name}_loss": value for name, value in loss._asdict().items() if name != "total"
    }
    module.log_dict(
        {f"{stage}/{name}": value.detach() for name, value in terms.items()},
        on_step=False,
        on_epoch=True,
        batch_size=count,
        sync_dist=True,
    )
