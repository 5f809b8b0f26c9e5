"""What `evaluate --json` writes: the figures, and all that one needs to get them again."""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from perception import __version__
from perception.cli.results_folder import write_whole


def write_json(path: Path, document: Any) -> None:  # noqa: ANN401 - anything `to_plain` takes
    """Write a document whole or not at all, making its folder; NaN becomes null."""
    text = json.dumps(to_plain(document), indent=1, allow_nan=False)
    write_whole(path, f"{text}\n".encode())


def to_plain(value: Any) -> Any:  # noqa: ANN401 - walks whatever configurations and figures hold
    """Turn dataclasses, arrays and paths into what JSON knows."""
    if dataclasses.is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [to_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value


@dataclasses.dataclass(frozen=True)
class DataUsed:
    """Which frames the figures are of.

    Attributes:
        root: folder of the drive.
        drive: name of the drive or sequence.
        sensor: name of the LiDAR model.
        frames: how many the drive has.
        first_frames: of these, how many were asked for, from the start.
        frames_evaluated: how many of those could be read.
    """

    root: Path
    drive: str
    sensor: str
    frames: int
    first_frames: int
    frames_evaluated: int


@dataclasses.dataclass(frozen=True)
class Figures:
    """What was measured, and how.

    Attributes:
        measure: ground or obstacles.
        protocol: in words and values.
        results: named figures.
    """

    measure: str
    protocol: dict[str, Any]
    results: dict[str, Any]


def write_evaluation(path: Path, data: DataUsed, configuration: object, figures: Figures) -> None:
    """Write the figures, and all that one needs to get them again."""
    document = {
        "measure": figures.measure,
        "program": f"trifuse {__version__}",
        "data": data,
        "split": "none: no frame was trained on, and none left out between the first and the last",
        "protocol": figures.protocol,
        "configuration": configuration,
        "results": figures.results,
    }
    write_json(path, document)
