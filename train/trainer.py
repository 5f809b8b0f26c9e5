"""One way to train every network: followed in TensorBoard, kept in two checkpoints, gone on with.

OUT/best.ckpt                of the epoch with the best validation figure
OUT/last.ckpt                of the last whole epoch, to go on from
OUT/events.out.tfevents...   what TensorBoard shows
"""

import logging
import signal
import threading
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from lightning.pytorch import Callback, LightningDataModule, LightningModule, Trainer
from lightning.pytorch.callbacks import EarlyStopping, LearningRateMonitor, ModelCheckpoint
from lightning.pytorch.loggers import TensorBoardLogger
from lightning.pytorch.utilities import rank_zero_only

from perception.errors import UsageError
from train.checkpoint_writer import AtomicCheckpointIO, require_same_network
from train.progress import TrainingBar

BEST, LAST = "best.ckpt", "last.ckpt"
Accelerator = Literal["auto", "cpu", "gpu"]
Precision = Literal["32-true", "16-mixed", "bf16-mixed"]


@dataclass(frozen=True)
class TrainerConfig:
    """How long and on what a network is trained.

    Attributes:
        epochs: in all, those of a training that is gone on with included.
        accelerator: auto takes a GPU where there is one.
        devices: how many of them; processes, on a CPU.
        nodes: machines with as many devices each, started as Lightning says for a cluster.
        precision: of the numbers; mixed is faster on a GPU, and where a CPU has instructions for it.
        seed: of every choice.
        monitor: the logged figure whose highest value marks the best epoch.
        patience: epochs without a better one after which training ends; None goes through all.
        fast_dev_run: one batch of each kind and nothing written, to see that everything fits.
    """

    epochs: int = 40
    accelerator: Accelerator = "auto"
    devices: int = 1
    nodes: int = 1
    precision: Precision = "32-true"
    seed: int = 0
    monitor: str = "validation/balanced"
    patience: int | None = None
    fast_dev_run: bool = False

    def __post_init__(self) -> None:
        """Refuse what cannot work."""
        if min(self.epochs, self.devices, self.nodes) < 1:
            found = f"{self.epochs} epochs, {self.devices} devices, {self.nodes} nodes"
            raise UsageError("training", expected="at least one of each", found=found)
        if self.patience is not None and self.patience < 1:
            found = f"{self.patience}"
            raise UsageError("patience", expected="at least one epoch", found=found)
        if self.accelerator == "gpu" and not torch.cuda.is_available():
            raise UsageError("--accelerator gpu", expected="a GPU that torch sees", found="none")


class SeedEachStep(Callback):
    """Draw what a step draws from the seed and its number, so that going on changes nothing."""

    def __init__(self, seed: int) -> None:
        self._seed = seed

    def on_train_batch_start(
        self, trainer: Trainer, pl_module: LightningModule, batch: object, batch_idx: int
    ) -> None:
        """Seed torch; each process draws its own."""
        numbers = (self._seed, trainer.global_step, trainer.global_rank)
        torch.manual_seed(int(np.random.SeedSequence(numbers).generate_state(1)[0]))


def make_trainer(out: Path, config: TrainerConfig, callbacks: Sequence[Callback] = ()) -> Trainer:
    """Return a trainer that writes to a folder.

    Args:
        out: the folder.
        config: how long and on what.
        callbacks: more, such as those that draw.
    """
    _silence_lightning()
    best = ModelCheckpoint(
        out,
        filename=Path(BEST).stem,
        monitor=config.monitor,
        mode="max",
        save_on_train_epoch_end=True,
        enable_version_counter=False,
    )
    last = ModelCheckpoint(
        out,
        filename=Path(LAST).stem,
        save_on_train_epoch_end=True,
        enable_version_counter=False,
    )
    patient = (
        [EarlyStopping(config.monitor, mode="max", patience=config.patience)]
        if config.patience
        else []
    )
    return Trainer(
        accelerator=config.accelerator,
        devices=config.devices,
        num_nodes=config.nodes,
        strategy="ddp" if config.devices * config.nodes > 1 else "auto",
        precision=config.precision,
        max_epochs=config.epochs,
        # Data modules share the samples out by themselves: only they know what makes a fair share.
        use_distributed_sampler=False,
        logger=TensorBoardLogger(out, name="", version="", default_hp_metric=False),
        callbacks=[
            SeedEachStep(config.seed),
            LearningRateMonitor("epoch"),
            *callbacks,
            TrainingBar(),
            *patient,
            best,
            last,
        ],
        plugins=[AtomicCheckpointIO()],
        deterministic="warn",
        fast_dev_run=config.fast_dev_run,
        num_sanity_val_steps=0,
        log_every_n_steps=10,
        enable_model_summary=False,
    )


def fit(
    trainer: Trainer,
    module: LightningModule,
    data: LightningDataModule,
    resume: Path | None = None,
) -> None:
    """Train, from a checkpoint on where one is given.

    Raises:
        ModelError: where the checkpoint is damaged or of another network, or the disk is full.
        KeyboardInterrupt: where it is stopped; what was written is kept.
    """
    if resume is not None:
        require_same_network(resume, module)
    interrupt = signal.getsignal(signal.SIGINT)
    try:
        trainer.fit(module, datamodule=data, ckpt_path=resume, weights_only=True)
    except SystemExit as stopped:
        # Lightning ends the program itself; who called decides that here.
        raise KeyboardInterrupt from stopped
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, interrupt)


def checkpoint_to_resume(out: Path, resume: str | None) -> Path | None:
    """Return the checkpoint to go on from, and refuse to begin where another training lies.

    Args:
        out: the folder of the training.
        resume: a checkpoint, the word last for that of the folder, or None to begin anew.
    """
    if resume is not None:
        return out / LAST if resume == "last" else Path(resume)
    if (out / LAST).exists():
        raise UsageError(
            out,
            expected="a folder without a training",
            found=LAST,
            advice="go on with --resume last, or name another --out",
        )
    return None


def fastest_precision(accelerator: Accelerator) -> Precision:
    """Return bfloat16 beside float32 where the device has instructions for it, else float32 alone."""
    if accelerator != "cpu" and torch.cuda.is_available():
        is_fast = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        # Older versions of torch do not tell what a CPU has.
        known = torch.cpu.get_capabilities() if hasattr(torch.cpu, "get_capabilities") else {}
        is_fast = bool(known.get("avx512_bf16") or known.get("amx_bf16"))
    return "bf16-mixed" if is_fast else "32-true"


def is_first_process() -> bool:
    """Tell whether this is the one of several training processes that writes and prints."""
    return int(getattr(rank_zero_only, "rank", 0) or 0) == 0


def _silence_lightning() -> None:
    """Let Lightning say only what somebody has to act on."""
    for name in ("lightning.pytorch", "lightning.fabric"):
        logging.getLogger(name).setLevel(logging.WARNING)
    for about in (
        ".*does not have many workers.*",
        ".*Checkpoint directory.*exists.*",
        ".*smaller than the logging interval.*",
        ".*GPU available but not used.*",
        ".*`isinstance.treespec, LeafSpec.` is deprecated.*",
    ):
        warnings.filterwarnings("ignore", about)
