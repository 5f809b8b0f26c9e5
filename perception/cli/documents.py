"""Configurations and figures as JSON and YAML documents."""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from data.atomic_file import write_atomically
from perception import __version__
from perception.types import Drive


def write_json(path: Path, document: Any) -> None:  # noqa: ANN401 - anything `to_serializable` takes
    """Write a document whole or not at all, making its folder; NaN becomes null."""
    text = json.dumps(to_serializable(document), indent=1, allow_nan=False)
    write_atomically(path, f"{text}\n".encode())


def to_serializable(value: Any) -> Any:  # noqa: ANN401 - walks whatever configurations and figures hold
    """Turn dataclasses, arrays and paths into what JSON knows."""
    if dataclasses.is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(key): to_serializable(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [to_serializable(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value


def write_yaml(path: Path, document: Any) -> None:  # noqa: ANN401 - anything `to_serializable` takes
    """Write a document whole or not at all, keeping the order of its fields."""
    write_atomically(path, yaml.safe_dump(to_serializable(document), sort_keys=False).encode())


def write_config(out: Path, drive: Drive, **effective: object) -> None:
    """Write `config.yaml` into a folder of results: what they were made from, and with what."""
    document = {
        "trifuse": __version__,
        "drive": drive.root.resolve(),
        "name": drive.name,
        "sensor": drive.sensor.name,
        **effective,
    }
    write_yaml(out / "config.yaml", document)
