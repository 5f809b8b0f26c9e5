"""What `evaluate --json` writes: the figures, and all that one needs to get them again."""

import dataclasses
from pathlib import Path
from typing import Any

from data.results.documents import write_json
from perception import __version__


@dataclasses.dataclass(frozen=True)
class DatasetInfo:
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
class Evaluation:
    """What was measured, and how.

    Attributes:
        measure: ground, obstacles ...
        protocol: in words and values.
        results: named figures.
    """

    measure: str
    protocol: dict[str, Any]
    results: dict[str, Any]


_NO_SPLIT = "none: no frame was trained on, and none left out between the first and the last"


def write_evaluation(
    path: Path, data: object, configuration: object, evaluation: Evaluation, split: str = _NO_SPLIT
) -> None:
    """Write the figures, and all that one needs to get them again.

    Args:
        path: of the JSON file.
        data: which were evaluated: `DatasetInfo` of a drive.
        configuration: of what was evaluated.
        evaluation: what was measured.
        split: in words, what was trained on and what left out.
    """
    document = {
        "measure": evaluation.measure,
        "program": f"trifuse {__version__}",
        "data": data,
        "split": split,
        "protocol": evaluation.protocol,
        "configuration": configuration,
        "results": evaluation.results,
    }
    write_json(path, document)
