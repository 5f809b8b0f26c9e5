"""Checkpoints, read without Lightning and without executing code, and the revision that model files state."""

import subprocess
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar
from zipfile import BadZipFile, ZipFile, is_zipfile

import torch
from torch import nn

from data.splits.training_frames import ENTRY
from perception import __version__
from perception.errors import ModelError, UsageError

Network = TypeVar("Network", bound=nn.Module)
Content = dict[str, Any]
_ENTRIES = {"state_dict": dict, "hyper_parameters": dict, "epoch": int}


def load_network(
    path: Path, model: str, make: Callable[[Content], tuple[Network, dict[str, str]]]
) -> tuple[Network, dict[str, str]]:
    """Return the network of a checkpoint in evaluation mode, and the metadata of its model file.

    Args:
        path: Checkpoint file.
        model: Kind of model, its hyperparameter `model`.
        make: Function from the content of the file to a network with random weights, and to metadata.

    Raises:
        ModelError: there is no such file, it is damaged, of another model, or its weights have other sizes.
    """
    content = read_checkpoint(path, model)
    try:
        network, metadata = make(content)
    except (AttributeError, KeyError, TypeError, UsageError, ValueError) as error:
        raise ModelError(
            path, expected=f"hyperparameters of a {model}", found=f"others ({error})"
        ) from error
    try:
        network.load_state_dict(weights_of(content, "network"))
    except (AttributeError, RuntimeError, TypeError) as error:
        found = "weights of other sizes"
        raise ModelError(path, expected=f"weights of this {model}", found=found) from error
    found = content["hyper_parameters"]
    stated = {name: str(found.get(name, "unknown")) for name in ("training_data", "revision")}
    stated |= {name: str(found[name]) for name in ("split", "part", ENTRY) if name in found}
    return network.eval(), metadata | stated | {"epochs": str(content["epoch"] + 1)}


def read_checkpoint(path: Path, *models: str) -> Content:
    """Return a checkpoint that Lightning wrote: `state_dict`, `hyper_parameters`, `epoch` and more.

    Args:
        path: Checkpoint file.
        models: Kinds of models, one of which its hyperparameter `model` must be.

    Raises:
        ModelError: there is no such file, it is damaged, or of another model.
    """
    expected = f"a checkpoint of {' or '.join(models)}"
    content = load_tensors(path, expected)
    entries: Content = content if isinstance(content, dict) else {}
    missing = [name for name, kind in _ENTRIES.items() if not isinstance(entries.get(name), kind)]
    if missing:
        raise ModelError(path, expected=expected, found=f"a file without {', '.join(missing)}")
    model = entries["hyper_parameters"].get("model")
    if model not in models:
        raise ModelError(path, expected=expected, found=f"one of {model}")
    return entries


def load_tensors(path: Path, expected: str) -> Any:  # noqa: ANN401 - what the file holds
    """Return tensors and plain values of a file, never executing code.

    Raises:
        ModelError: there is no such file, or it cannot be read.
    """
    try:
        with warnings.catch_warnings(action="ignore"):  # of a file that is refused in a sentence
            content = torch.load(path, map_location="cpu", weights_only=True)
        _require_intact(path)  # torch does not compare checksums
    except Exception as error:  # of a damaged file, torch raises errors of any type
        found = "a file that cannot be read" if path.is_file() else "no such file"
        raise ModelError(path, expected=expected, found=found) from error
    return content


def weights_of(checkpoint: Content, part: str) -> dict[str, torch.Tensor]:
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


def _require_intact(path: Path) -> None:
    if is_zipfile(path):
        with ZipFile(path) as file:
            if file.testzip() is not None:
                raise BadZipFile
