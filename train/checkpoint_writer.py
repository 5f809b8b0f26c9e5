"""Lightning's checkpoints, written whole or not at all, and read as data only."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from lightning.fabric.plugins import TorchCheckpointIO
from lightning.pytorch import LightningModule

from perception.atomic_file import write_atomically
from perception.errors import ModelError
from train.checkpoints import Content, load_tensors, read_checkpoint


class AtomicCheckpointIO(TorchCheckpointIO):
    """A run that is killed, or finds the disk full, leaves the checkpoint that was there before."""

    def save_checkpoint(
        self,
        checkpoint: dict[str, Any],
        path: str | Path,
        storage_options: object = None,
    ) -> None:
        """Write beside the old file, then take its place."""
        write_checkpoint(Path(path), checkpoint)

    def load_checkpoint(
        self,
        path: str | Path,
        map_location: object = None,
        weights_only: bool | None = True,
    ) -> dict[str, Any]:
        """Read tensors and plain values, never code."""
        return dict(load_tensors(Path(path), "a checkpoint to resume from"))


def write_checkpoint(path: Path, content: Content) -> None:
    """Write a checkpoint whole or not at all."""
    data = io.BytesIO()
    torch.save(content, data)
    write_atomically(path, data.getvalue())


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
