"""Lightning's checkpoints, written whole or not at all, and read as data only."""

import io
from collections.abc import Mapping, Sequence
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
    checkpoint: Path, module: LightningModule, *, is_resumed: bool = True
) -> None:
    """Validate that a checkpoint is of the same network, and of the same optimizer where it is resumed.

    Args:
        checkpoint: Checkpoint file.
        module: Network to train or to evaluate; its `identity` names the hyperparameters that must be equal.
        is_resumed: Whether the state of the optimizer is used.

    Raises:
        ModelError: it is missing, damaged, of another model, network or optimizer.
    """
    content = require_same_network(checkpoint, module.hparams, module.identity)  # type: ignore[arg-type]
    theirs = {
        name: getattr(weight, "shape", None) for name, weight in content["state_dict"].items()
    }
    stated = content["hyper_parameters"]
    if theirs != {name: weight.shape for name, weight in module.state_dict().items()}:
        found = "that of another network"
    elif is_resumed and "optimizer_states" not in content:
        found = "one without the state of this optimizer"
    elif is_resumed and _class_of(stated) != _class_of(module.hparams):
        found = "that of another optimizer"
    else:
        return
    raise ModelError(
        checkpoint,
        expected=f"the training of this {module.hparams['model']}",
        found=found,
        advice="resume from last.ckpt with the flags of its training",
    )


def require_same_network(
    checkpoint: Path, hyper_parameters: Mapping[str, Any], identity: Sequence[str]
) -> Content:
    """Return the content of a checkpoint of the same model, whose named hyperparameters are equal.

    Args:
        checkpoint: Checkpoint file.
        hyper_parameters: Hyperparameters of the network.
        identity: Names of those that must be equal.

    Raises:
        ModelError: it is missing, damaged, of another model, or differs.
    """
    content = read_checkpoint(checkpoint, str(hyper_parameters["model"]))
    require_same(checkpoint, hyper_parameters, content["hyper_parameters"], identity)
    return content


def require_same(
    file: Path,
    hyper_parameters: Mapping[str, Any],
    stated: Mapping[str, Any],
    identity: Sequence[str],
) -> None:
    """Validate that a file states the same as a network.

    Args:
        file: Checkpoint or model file.
        hyper_parameters: Hyperparameters of the network.
        stated: Those that the file states.
        identity: Names of those that must be equal.

    Raises:
        ModelError: one differs.
    """
    for name in identity:
        expected, found = str(hyper_parameters[name]), str(stated.get(name))
        if expected != found:
            raise ModelError(
                file,
                expected=f"a {hyper_parameters['model']} whose {name} is {expected}",
                found=found,
                advice="give the flags of its training",
            )


def _class_of(hyper_parameters: Mapping[str, Any]) -> object:
    optimizer = hyper_parameters.get("optimizer")
    return optimizer.get("class_path") if isinstance(optimizer, Mapping) else None
