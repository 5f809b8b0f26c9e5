"""Training of any network by Lightning, with checkpoints, TensorBoard and resume.

OUT/best.ckpt                checkpoint of the epoch with the best validation metric
OUT/last.ckpt                checkpoint of the last whole epoch, to resume from
OUT/events.out.tfevents...   TensorBoard events
"""

import logging
import signal
import threading
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from lightning.pytorch import Callback, LightningDataModule, LightningModule, Trainer
from lightning.pytorch.callbacks import EarlyStopping, LearningRateMonitor, ModelCheckpoint
from lightning.pytorch.loggers import TensorBoardLogger
from lightning.pytorch.utilities import rank_zero_only

from data.results.documents import write_yaml
from perception import __version__
from perception.errors import UsageError
from train.checkpoint_writer import AtomicCheckpointIO, require_same_network
from train.config import Accelerator, DevicePrecision, TrainingRun
from train.progress import TrainingBar

BEST, LAST = "best.ckpt", "last.ckpt"


class SeedEachStep(Callback):
    """Seed each step by seed and step, so that resumed training draws the same."""

    def __init__(self, seed: int) -> None:
        self._seed = seed

    def on_train_batch_start(
        self, trainer: Trainer, pl_module: LightningModule, batch: object, batch_idx: int
    ) -> None:
        """Seed torch, differently in each process."""
        numbers = (self._seed, trainer.global_step, trainer.global_rank)
        torch.manual_seed(int(np.random.SeedSequence(numbers).generate_state(1)[0]))


def make_trainer(
    out: Path, run: TrainingRun, monitor: str, callbacks: Sequence[Callback] = ()
) -> Trainer:
    """Return a trainer that writes to a folder.

    Args:
        out: Folder of checkpoints and events.
        run: Epochs, devices and seed.
        monitor: Logged metric whose highest value marks the best epoch.
        callbacks: Further callbacks, such as those that draw.

    Raises:
        UsageError: a GPU is asked for and torch has none.
    """
    _silence_lightning()
    if run.accelerator == "gpu" and not torch.cuda.is_available():
        raise UsageError(
            "--trainer.accelerator gpu", expected="a GPU that torch sees", found="none"
        )
    best = ModelCheckpoint(
        out,
        filename=Path(BEST).stem,
        monitor=monitor,
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
    patient = [EarlyStopping(monitor, mode="max", patience=run.patience)] if run.patience else []
    return Trainer(
        accelerator=run.accelerator,
        devices=run.devices,
        num_nodes=run.nodes,
        strategy="ddp" if run.devices * run.nodes > 1 else "auto",
        precision=resolve_precision(run),
        max_epochs=run.epochs,
        # Data modules distribute their samples themselves.
        use_distributed_sampler=False,
        logger=TensorBoardLogger(out, name="", version="", default_hp_metric=False),
        callbacks=[
            SeedEachStep(run.seed),
            LearningRateMonitor("epoch"),
            *callbacks,
            TrainingBar(),
            *patient,
            best,
            last,
        ],
        plugins=[AtomicCheckpointIO()],
        deterministic="warn",
        fast_dev_run=run.fast_dev_run,
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
    """Train, or resume from a checkpoint.

    Raises:
        ModelError: the checkpoint is damaged or of another network, or the disk is full.
        KeyboardInterrupt: the training is stopped; what was written is kept.
    """
    if resume is not None:
        require_same_network(resume, module)
    interrupt = signal.getsignal(signal.SIGINT)
    try:
        trainer.fit(module, datamodule=data, ckpt_path=resume, weights_only=True)
    except SystemExit as stopped:
        # Lightning ends the program itself; the caller decides that here.
        raise KeyboardInterrupt from stopped
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, interrupt)


def checkpoint_to_resume(out: Path, resume: str | None) -> Path | None:
    """Return the checkpoint to resume from, None for a new training.

    Args:
        out: Folder of the training.
        resume: Checkpoint, the word last for that of the folder, or None.

    Raises:
        UsageError: a new training is asked for in the folder of another.
    """
    if resume is not None:
        return out / LAST if resume == "last" else Path(resume)
    if (out / LAST).exists():
        raise UsageError(
            out,
            expected="a folder without a training",
            found=LAST,
            advice="resume it with --resume last, or name another --out",
        )
    return None


def start_experiment(out: Path, resume: str | None, **settings: object) -> Path | None:
    """Write `config.yaml` of an experiment in the first process; return the checkpoint to resume from.

    Args:
        out: Folder of the training.
        resume: Checkpoint, the word last for that of the folder, or None.
        **settings: Sections of the configuration.

    Raises:
        UsageError: a new training is asked for in the folder of another.
    """
    checkpoint = checkpoint_to_resume(out, resume)
    if int(getattr(rank_zero_only, "rank", 0) or 0) == 0:
        document = {"program": f"trifuse {__version__}", **settings, "resumed_from": checkpoint}
        write_yaml(out / "config.yaml", document)
    return checkpoint


def resolve_precision(run: TrainingRun) -> DevicePrecision:
    """Return the number format of a training; auto is the fastest of its device."""
    return fastest_precision(run.accelerator) if run.precision == "auto" else run.precision


def fastest_precision(accelerator: Accelerator) -> DevicePrecision:
    """Return bfloat16 mixed with float32 where the device has instructions for it, else float32."""
    if accelerator != "cpu" and torch.cuda.is_available():
        is_fast = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        # Older versions of torch do not report what a CPU has.
        known = torch.cpu.get_capabilities() if hasattr(torch.cpu, "get_capabilities") else {}
        is_fast = bool(known.get("avx512_bf16") or known.get("amx_bf16"))
    return "bf16-mixed" if is_fast else "32-true"


def _silence_lightning() -> None:
    """Silence those messages of Lightning that need no action."""
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
