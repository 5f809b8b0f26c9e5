"""The trainer that the fusion used until it goes through Lightning's command line as the others do."""

import math
import signal
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Self

from lightning.pytorch import Callback, LightningDataModule, LightningModule, Trainer
from lightning.pytorch.callbacks import Checkpoint, LambdaCallback, LearningRateMonitor
from lightning.pytorch.loggers import TensorBoardLogger
from torch import nn
from torch.optim import SGD, AdamW, Optimizer
from torch.optim.lr_scheduler import LambdaLR

from perception.errors import ModelError, UsageError
from train.best_epoch import Ranking
from train.checkpoint_writer import AtomicCheckpointIO
from train.checkpoints import read_checkpoint
from train.config import DevicePrecision, OptimizerConfig, TrainingRun
from train.events import TrainingStatistics, event_logger, log_hyperparameters, writing_events
from train.progress import TrainingBar
from train.trainer import SeedEachStep
from train.trainer import silence_lightning as _silence_lightning

BEST, LAST = "best.ckpt", "last.ckpt"
_EPOCHS_PER_STAGE = 8


def _require_devices(run: TrainingRun) -> None:
    """Accept any."""


def resolve_precision(run: TrainingRun) -> DevicePrecision:
    """Return the number format."""
    return "32-true"


@dataclass(frozen=True)
class TrainingFolder:
    """Folder of a training, and what happens there when it starts.

    Attributes:
        out: Folder of checkpoints and events.
        resume: Checkpoint of the same training to resume from.
        on_start: Function that writes the configuration; the first process calls it once nothing can be
            refused any more.
    """

    out: Path
    resume: Path | None = None
    on_start: Callable[[], object] = lambda: None

    @classmethod
    def open(cls, out: Path, resume: str | None, on_start: Callable[[], object]) -> Self:
        """Return the folder of a new or a resumed training.

        Args:
            out: Folder of the training.
            resume: Checkpoint, the word last for that of the folder, or None for a new training.
            on_start: Function that writes the configuration.

        Raises:
            UsageError: a new training is asked for in the folder of another.
        """
        if resume is None and (out / LAST).exists():
            raise UsageError(
                out,
                expected="a folder without a training",
                found=LAST,
                advice="resume it with --resume last, or name another --out",
            )
        if resume is None:
            return cls(out, None, on_start)
        return cls(out, out / LAST if resume == "last" else Path(resume), on_start)

    @property
    def best(self) -> Path:
        """Checkpoint of the best epoch."""
        return self.out / BEST

    @property
    def last(self) -> Path:
        """Checkpoint of the last whole epoch."""
        return self.out / LAST


class BestEpoch(Checkpoint):
    """Write last.ckpt after each epoch and best.ckpt after the best; stop after some epochs without a better one.

    The best epoch's metrics are logged with the hyperparameters, for TensorBoard's table of all trainings.
    """

    def __init__(
        self, folder: TrainingFolder, ranking: Ranking, patience: int | None = None
    ) -> None:
        """Take folder, order and patience.

        Args:
            folder: Folder of the checkpoints.
            ranking: Criteria of the best epoch.
            patience: Epochs without a better one after which training stops; None for no limit.
        """
        self._folder, self._ranking, self._patience = folder, ranking, patience
        self._best: dict[str, float] = {}
        self._epochs_without_better = 0

    def on_train_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Compare the epoch with the best one, and write its checkpoints."""
        if trainer.fast_dev_run:  # type: ignore[attr-defined]
            return
        logged = trainer.callback_metrics
        metrics = {one.metric: float(logged[one.metric]) for one in self._ranking}
        is_best = not self._best or self._worth(metrics) > self._worth(self._best)
        self._best = metrics if is_best else self._best
        self._epochs_without_better = 0 if is_best else self._epochs_without_better + 1
        if is_best:
            trainer.save_checkpoint(self._folder.best)
        trainer.save_checkpoint(self._folder.last)
        if self._patience is not None and self._epochs_without_better >= self._patience:
            trainer.should_stop = True

    def on_train_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Log hyperparameters and metrics of the best epoch."""
        for logger in trainer.loggers:
            if isinstance(logger, TensorBoardLogger) and self._best:
                log_hyperparameters(logger, dict(pl_module.hparams), self._best)

    def on_exception(
        self, trainer: Trainer, pl_module: LightningModule, exception: BaseException
    ) -> None:
        """Log them of what was trained until then."""
        self.on_train_end(trainer, pl_module)

    def state_dict(self) -> dict[str, Any]:
        """Return the state that a checkpoint keeps."""
        return {"best": self._best, "epochs_without_better": self._epochs_without_better}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Take the state of a checkpoint."""
        self._best = state_dict["best"]
        self._epochs_without_better = state_dict["epochs_without_better"]

    def _worth(self, metrics: Mapping[str, float]) -> tuple[float, ...]:
        return tuple(one.worth(metrics) for one in self._ranking)


def fit(
    module: LightningModule,
    data: LightningDataModule,
    ranking: Ranking,
    run: TrainingRun,
    folder: TrainingFolder,
    callbacks: Sequence[Callback] = (),
) -> Path | None:
    """Train, or resume; return the checkpoint of the best epoch.

    All processes but the first return None, and so does a fast_dev_run.

    Args:
        module: Network to train.
        data: Training and validation data.
        ranking: Criteria of the best epoch.
        run: Epochs, devices and seed.
        folder: Folder of the training.
        callbacks: Further callbacks, such as those that draw.

    Raises:
        ModelError: the checkpoint is damaged, or of another training.
        UsageError: the devices are not there.
        WriteError: a checkpoint or an event cannot be written.
        KeyboardInterrupt: the training is stopped; what was written is kept.
    """
    if folder.resume is not None:
        require_same_training(folder.resume, module)
    trainer = make_trainer(ranking, run, folder, callbacks)
    interrupt = signal.getsignal(signal.SIGINT)
    try:
        with writing_events(folder.out):
            trainer.fit(module, datamodule=data, ckpt_path=folder.resume, weights_only=True)
    except SystemExit as stopped:
        # Lightning ends the program itself; the caller decides that here.
        raise KeyboardInterrupt from stopped
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, interrupt)
    is_first = trainer.is_global_zero and not run.fast_dev_run
    return folder.best if is_first else None


def make_trainer(
    ranking: Ranking, run: TrainingRun, folder: TrainingFolder, callbacks: Sequence[Callback] = ()
) -> Trainer:
    """Return a trainer that writes to a folder; arguments as of `fit`.

    Raises:
        UsageError: the devices are not there.
    """
    _silence_lightning()
    _require_devices(run)

    def start(trainer: Trainer, module: LightningModule) -> None:
        if trainer.is_global_zero and not run.fast_dev_run:
            folder.on_start()

    return Trainer(
        accelerator=run.accelerator,
        devices=run.devices,
        num_nodes=run.nodes,
        strategy="ddp" if run.devices * run.nodes > 1 else "auto",
        precision=resolve_precision(run),
        max_epochs=run.epochs,
        # Data modules distribute their samples themselves.
        use_distributed_sampler=False,
        logger=event_logger(folder.out),
        callbacks=[
            SeedEachStep(run.seed),
            LambdaCallback(on_train_start=start),
            LearningRateMonitor("epoch"),
            *callbacks,
            TrainingStatistics(),
            TrainingBar(),
            BestEpoch(folder, ranking, run.patience),
        ],
        plugins=[AtomicCheckpointIO()],
        deterministic="warn",
        fast_dev_run=run.fast_dev_run,
        num_sanity_val_steps=0,
        log_every_n_steps=10,
        enable_model_summary=False,
    )


def configure_optimizers(
    module: LightningModule, network: nn.Module, config: OptimizerConfig
) -> dict[str, Any]:
    """Return optimizer and schedule of a network's weights, for `LightningModule.configure_optimizers`."""
    optimizer = make_optimizer(network, config)
    steps = int(module.trainer.estimated_stepping_batches)
    factor = learning_rate_factor(config, steps, module.trainer.max_epochs or 1)
    schedule = {"scheduler": LambdaLR(optimizer, factor), "interval": "step"}
    return {"optimizer": optimizer, "lr_scheduler": schedule}


def make_optimizer(network: nn.Module, config: OptimizerConfig) -> Optimizer:
    """Return the optimizer of a network's weights; vectors and biases do not decay."""
    weights = [weight for weight in network.parameters() if weight.requires_grad]
    groups = [
        {"params": [w for w in weights if w.ndim > 1], "weight_decay": config.weight_decay},
        {"params": [w for w in weights if w.ndim <= 1], "weight_decay": 0.0},
    ]
    if config.optimizer == "sgd":
        return SGD(groups, lr=config.learning_rate, momentum=config.momentum)
    return AdamW(groups, lr=config.learning_rate)


def learning_rate_factor(
    config: OptimizerConfig, steps: int, epochs: int = 1
) -> Callable[[int], float]:
    """Return the function from a step to the factor of the largest learning rate."""
    if config.schedule == "step":
        per_stage = _EPOCHS_PER_STAGE * max(steps // epochs, 1)
        return partial(step_decay, steps_per_stage=per_stage)
    schedule = burn_in_steps if config.schedule == "darknet" else warmup_cosine
    return partial(schedule, steps=steps)


def step_decay(step: int, steps_per_stage: int, factor: float = 0.1) -> float:
    """Return 1 in the first stage, and `factor` times less in each that follows."""
    return float(factor ** (step // max(steps_per_stage, 1)))


def warmup_cosine(step: int, steps: int, warm: float = 0.1, last: float = 0.001) -> float:
    """Return a factor that rises over the first steps, then falls along half a cosine.

    Args:
        step: Step of the training, from 0.
        steps: Number of steps of the training.
        warm: Fraction of the steps in which it rises.
        last: Factor at the end.
    """
    done = min((step + 1) / max(steps, 1), 1.0)
    if done < warm:
        return done / warm
    fallen = (1 - math.cos(math.pi * (done - warm) / (1 - warm))) / 2
    return 1 - (1 - last) * fallen


def burn_in_steps(step: int, steps: int) -> float:
    """Return the factor of Darknet's burn-in and steps policy.

    `yolo-voc.cfg` has 80200 steps: the rate rises with the fourth power over 1000, and falls after
    40000 and after 60000. Here these are scaled to the number of steps.
    """
    done = (step + 1) * 80_200 / max(steps, 1)
    if done < 1000:
        return float((done / 1000) ** 4)
    return 0.1 ** ((done > 40_000) + (done > 60_000))


def require_same_training(
    checkpoint: Path, module: LightningModule, state: str = "optimizer_states"
) -> None:
    """Validate that a training can be resumed from a checkpoint.

    Args:
        checkpoint: Checkpoint file.
        module: Network to train.
        state: Entry of the checkpoint with the state of the optimizer.

    Raises:
        ModelError: it is missing, damaged, of another model, network or optimizer.
    """
    model = str(module.hparams["model"])
    content = read_checkpoint(checkpoint, model)
    theirs = {
        name: getattr(weight, "shape", None) for name, weight in content["state_dict"].items()
    }
    if theirs != {name: weight.shape for name, weight in module.state_dict().items()}:
        found = "that of another network"
    elif state not in content:
        found = "one without the state of this optimizer"
    elif _optimizer(content["hyper_parameters"]) != _optimizer(module.hparams):
        found = "that of another optimizer"
    else:
        return
    raise ModelError(
        checkpoint,
        expected=f"the training of this {model}",
        found=found,
        advice="resume from last.ckpt with the flags of its training",
    )


def _optimizer(hyper_parameters: Mapping[str, Any]) -> object:
    optimizer = hyper_parameters.get("optimizer")
    return optimizer.get("optimizer") if isinstance(optimizer, Mapping) else optimizer
