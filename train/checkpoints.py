"""Checkpoints of training, read without Lightning and without running what a file may hold."""

import pickle
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import torch

from perception.errors import ModelError


def read_checkpoint(path: Path, *models: str) -> dict[str, Any]:
    """Return what Lightning wrote of a model: `state_dict`, `hyper_parameters` and more.

    Args:
        path: of the checkpoint.
        models: one of which the checkpoint must be of; its hyper-parameter `model`.

    Raises:
        ModelError: where there is no such file, it is damaged, or holds another model.
    """
    expected = f"a checkpoint of {' or '.join(models)}"
    if not path.is_file():
        raise ModelError(path, expected=expected, found="no such file")
    try:
        checkpoint = torch.load(path, map_location="cpu", weights_only=True)
    except (RuntimeError, EOFError, OSError, pickle.UnpicklingError, BadZipFile) as error:
        raise ModelError(path, expected=expected, found="a file that cannot be read") from error
    found = model_of(checkpoint)
    if found not in models:
        raise ModelError(path, expected=expected, found=f"one of {found}" if found else "another")
    return dict(checkpoint)


def model_of(checkpoint: object) -> str | None:
    """Return the name of the model that a checkpoint is of, or None where it does not say."""
    if not isinstance(checkpoint, dict) or "state_dict" not in checkpoint:
        return None
    name = checkpoint.get("hyper_parameters", {}).get("model")
    return None if name is None else str(name)


def weights_of(checkpoint: dict[str, Any], part: str) -> dict[str, torch.Tensor]:
    """Return the weights of one part of a LightningModule, as that part itself calls them."""
    prefix = f"{part}."
    return {
        name.removeprefix(prefix): weight
        for name, weight in checkpoint["state_dict"].items()
        if name.startswith(prefix)
    }
