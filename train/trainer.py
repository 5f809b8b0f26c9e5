"""What all trainings share beside Lightning's own: seeds of steps, mean weights, number format, devices, interrupts."""

import logging
import signal
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
import torch
from lightning.pytorch import Callback, LightningModule, Trainer
from lightning.pytorch.callbacks import WeightAveraging
from torch import Tensor

from perception.errors import UsageError
from perception.geometry.threads import usable_cores


class SeedEachStep(Callback):
    """Seed each step by seed and step, so that resumed training draws the same."""

    def __init__(self, seed: int) -> None:
        self._seed = seed

    def on_train_batch_start(
        self, trainer: Trainer, pl_module: LightningModule, batch: object, batch_idx: int
    ) -> None:
        """Seed torch, differently in each process."""
        numbers = (self._seed, trainer.global_step, batch_idx, trainer.global_rank)
        torch.manual_seed(int(np.random.SeedSequence(numbers).generate_state(1)[0]))


def exponential_moving_average(decay: float = 0.0) -> Callback:
    """Return the callback that trains a moving average of the weights, which is evaluated and stored.

    Args:
        decay: Decay of the exponential moving average of the weights at every step; 0 for none.

    Raises:
        UsageError: the decay is no fraction.
    """
    if not 0 <= decay < 1:
        raise UsageError("--ema.decay", expected="from 0 to below 1", found=f"{decay:g}")
    return WeightAveraging(avg_fn=partial(_averaged, decay=decay)) if decay else Callback()


def _averaged(mean: Tensor, new: Tensor, count: Tensor | int, decay: float) -> Tensor:
    """Return the moving average; it is short at first, to forget the random weights soon."""
    now = torch.as_tensor((1 + count) / (10 + count)).clamp(max=decay)
    return mean * now + new * (1 - now)


def fastest_precision(accelerator: str) -> str:
    """Return bfloat16 mixed with float32 where the device has instructions for it, else float32."""
    if accelerator != "cpu" and torch.cuda.is_available():
        is_fast = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        # Older versions of torch do not report what a CPU has.
        known = torch.cpu.get_capabilities() if hasattr(torch.cpu, "get_capabilities") else {}
        is_fast = bool(known.get("avx512_bf16") or known.get("amx_bf16"))
    return "bf16-mixed" if is_fast else "32-true"


def require_devices(accelerator: str, devices: object) -> None:
    """Validate that this machine has the devices, before a process is started on each.

    Args:
        accelerator: Name of Lightning's accelerator.
        devices: Number of devices, or what else Lightning takes, which it validates itself.

    Raises:
        UsageError: there are fewer GPUs, or on a CPU fewer cores.
    """
    gpus = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if accelerator in ("gpu", "cuda") and not gpus:
        where = f"--trainer.accelerator {accelerator}"
        raise UsageError(where, expected="a GPU that torch sees", found="none")
    is_on_cpu = accelerator == "cpu" or not gpus
    available, unit = (usable_cores(), "cores") if is_on_cpu else (gpus, "GPUs")
    if isinstance(devices, int) and devices > available:
        raise UsageError(
            "--trainer.devices",
            expected=f"at most the {available} {unit} of this machine",
            found=str(devices),
        )


@contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C end a training only, not the program, and restore its handler.

    Raises:
        KeyboardInterrupt: the training was stopped.
    """
    interrupt = signal.getsignal(signal.SIGINT)
    try:
        yield
    except SystemExit as stopped:
        # Lightning ends the program itself; the caller decides that here.
        raise KeyboardInterrupt from stopped
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, interrupt)


def silence_lightning() -> None:
    """Silence those messages of Lightning that need no action."""
    for name in ("lightning.pytorch", "lightning.fabric"):
        logging.getLogger(name).setLevel(logging.WARNING)
    for about in (
        ".*does not have many workers.*",
        ".*in eval mode at the start of training.*",
        ".*Checkpoint directory.*exists.*",
        ".*smaller than the logging interval.*",
        ".*GPU available but not used.*",
        ".*`isinstance.treespec, LeafSpec.` is deprecated.*",
        ".*loading a checkpoint outside the 'fit' stage.*",
        ".*loading a checkpoint outside the fit stage.*",
        ".*args parameter is intended to run from within Python.*",
    ):
        warnings.filterwarnings("ignore", about)
