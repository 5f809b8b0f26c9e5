"""Training of any network by Lightning, with checkpoints, TensorBoard and resume.

OUT/best.ckpt                checkpoint of the best epoch
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
from lightning.pytorch.callbacks import LambdaCallback, LearningRateMonitor

from data.results.documents import usable_cores
from perception.errors import UsageError
from train.best_epoch import BestEpoch, Ranking
from train.checkpoint_writer import AtomicCheckpointIO, require_same_training
from train.config import Accelerator, DevicePrecision, TrainingRun
from train.events import TrainingStatistics, event_logger, writing_events
from train.folder import TrainingFolder
from train.progress import TrainingBar


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


def _require_devices(run: TrainingRun) -> None:
    """Validate that this machine has the devices, before a process is started on each.

    Raises:
        UsageError: there are fewer GPUs, or on a CPU fewer cores.
    """
    gpus = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if run.accelerator == "gpu" and not gpus:
        raise UsageError(
            "--trainer.accelerator gpu", expected="a GPU that torch sees", found="none"
        )
    is_on_cpu = run.accelerator == "cpu" or not gpus
    available, unit = (usable_cores(), "cores") if is_on_cpu else (gpus, "GPUs")
    if run.devices > available:
        raise UsageError(
            "--trainer.devices",
            expected=f"at most the {available} {unit} of this machine",
            found=str(run.devices),
        )


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
