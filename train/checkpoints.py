"""Checkpoints, read without Lightning and without executing code, and the revision that model files state."""

import pickle
import subprocess
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import torch

from perception import __version__
from perception.errors import ModelError


def read_checkpoint(path: Path, *models: str) -> dict[str, Any]:
    """Return a checkpoint that Lightning wrote: `state_dict`, `hyper_parameters` and more.

    Args:
        path: Checkpoint file.
        models: Kinds of models, one of which its hyper-parameter `model` must be.

    Raises:
        ModelError: there is no such file, it is damaged, or of another model.
    """
    expected = f"a checkpoint of {' or '.join(models)}"
    checkpoint = load_tensors(path, expected)
    found = model_of(checkpoint)
    if found not in models:
        raise ModelError(path, expected=expected, found=f"one of {found}" if found else "another")
    return dict(checkpoint)


def load_tensors(path: Path, expected: str) -> Any:  # noqa: ANN401 - what the file holds
    """Return tensors and plain values of a file, never executing code.

    Raises:
        ModelError: there is no such file, or it cannot be read.
    """
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except (RuntimeError, EOFError, OSError, pickle.UnpicklingError, BadZipFile) as error:
        found = "a file that cannot be read" if path.is_file() else "no such file"
        raise ModelError(path, expected=expected, found=found) from error


def model_of(checkpoint: object) -> str | None:
    """Return the kind of model of a checkpoint, or None where it states none."""
    if not isinstance(checkpoint, dict) or "state_dict" not in checkpoint:
        return None
    name = checkpoint.get("hyper_parameters", {}).get("model")
    return None if name is None else str(name)


def weights_of(checkpoint: dict[str, Any], part: str) -> dict[str, torch.Tensor]:
    """Return the weights of one part of a LightningModule by their names within it."""
    prefix = f"{part}."
    return {
        name.removeprefix(prefix): weight
        for name, weight in checkpoint["state_dict"].items()
        if name.startswith(prefix)
    }


def program_revision() -> str:
    """Return the commit of the source tree, marked + where files differ from it; else the version."""
    root = Path(__file__).parents[1]
    if not (root / ".git").exists():
        return __version__
    command = ["git", "-C", str(root), "describe", "--always", "--abbrev=12", "--dirty=+"]
    try:
        found = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return __version__
    return found.stdout.strip()
