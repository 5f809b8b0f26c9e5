"""Lightning's checkpoints, written whole or not at all, and read as data only."""

import io
from pathlib import Path
from typing import Any

import torch
from lightning.fabric.plugins import TorchCheckpointIO
from lightning.pytorch import LightningModule

from perception.atomic_file import write_atomically
from perception.errors import ModelError
from train.checkpoints import read_checkpoint


class AtomicCheckpointIO(TorchCheckpointIO):
    """A run that is killed, or finds the disk full, leaves the checkpoint that was there before."""

    def save_checkpoint(
        self,
        checkpoint: dict[str, Any],
        path: str | Path,
        storage_options: object = None,
    ) -> None:
        """Write beside the old file, then take its place."""
        content = io.BytesIO()
        torch.save(checkpoint, content)
        try:
            write_atomically(Path(path), content.getvalue())
        except OSError as error:
            raise ModelError(
                path,
                expected=f"room for {content.tell() / 1e6:.0f} MB",
                found=error.strerror or str(error),
                advice="make room and go on with --resume last",
            ) from error

    def load_checkpoint(
        self,
        path: str | Path,
        map_location: Any = None,  # noqa: ANN401 - as torch.load takes it
        weights_only: bool | None = True,
    ) -> dict[str, Any]:
        """Read tensors and plain values, never code."""
        found: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
        return found


def require_same_network(checkpoint: Path, module: LightningModule) -> None:
    """Validate that a checkpoint is of the same network.

    Raises:
        ModelError: where it is missing, damaged, of another model, or its weights have other sizes.
    """
    model = str(module.hparams["model"])
    content = read_checkpoint(checkpoint, model)
    theirs = {name: weight.shape for name, weight in content["state_dict"].items()}
    ours = {name: weight.shape for name, weight in module.state_dict().items()}
    if theirs != ours:
        method = content["hyper_parameters"].get("method", "other")
        raise ModelError(
            checkpoint,
            expected=f"the weights of this {model}",
            found=f"those of another ({method})",
            advice="go on with the options that the checkpoint was made with",
        )
