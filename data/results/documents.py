"""Configurations and metrics as JSON and YAML documents, and the machine they were measured on."""

import dataclasses
import json
import math
import platform
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from perception.atomic_file import write_atomically
from perception.geometry.threads import usable_cores

_LEAVES = frozenset((float, int, str, bool, type(None)))


def write_json(path: Path, document: Any) -> None:  # noqa: ANN401 - see `to_serializable`
    """Write a JSON document atomically and make its folder; NaN becomes null."""
    text = json.dumps(to_serializable(document), indent=1, allow_nan=False)
    write_atomically(path, f"{text}\n".encode())


def write_yaml(path: Path, document: Any) -> None:  # noqa: ANN401 - see `to_serializable`
    """Write a YAML document atomically, with its fields in their order."""
    write_atomically(path, yaml_text(document).encode())


def to_serializable(value: Any) -> Any:  # noqa: ANN401 - walks any configuration or report
    """Return dataclasses, arrays and paths as types that JSON and YAML have; NaN as None.

    Of a dataclass these are the fields by which it is compared.
    """
    # What most values are comes first: a frame has thousands of numbers.
    if type(value) in _LEAVES:
        return None if type(value) is float and not math.isfinite(value) else value
    if dataclasses.is_dataclass(value):
        compared = (field.name for field in dataclasses.fields(value) if field.compare)
        value = {name: getattr(value, name) for name in compared}
    if isinstance(value, dict):
        return {str(key): to_serializable(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [to_serializable(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value


def describe_machine() -> str:
    """Return the processor, the number of usable cores, and the version of Python."""
    return f"{_processor()}, {usable_cores()} cores, Python {platform.python_version()}"


def yaml_text(document: object) -> str:
    """Return a document as YAML, with its fields in their order."""
    text: str = yaml.safe_dump(to_serializable(document), sort_keys=False)
    return text


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return " ".join(line.partition(":")[2].split())
    except OSError:
        pass
    return platform.processor() or platform.machine()
