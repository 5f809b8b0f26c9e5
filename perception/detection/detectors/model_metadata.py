"""What an exporter writes into an ONNX file's metadata: names of the classes, shape of the keypoints.

Both are literals of Python or JSON: `{0: 'car', 1: 'truck'}`, `["car", "truck"]`, `[17, 3]`.
"""

import ast
import json
import warnings
from collections.abc import Mapping
from typing import Any

from perception.errors import ModelError

_NAMES, _KEYPOINTS = "names", "kpt_shape"
_MAX_CHARACTERS = 1 << 18  # of one literal
_SHOWN_CHARACTERS = 60  # of one that is no such literal, in the error


def class_names(metadata: Mapping[str, str], file: str) -> dict[int, str]:
    """Return the names of a network's classes by number, none where its metadata do not name them.

    Raises:
        ModelError: the entry holds something else than names.
    """
    value = _literal(metadata.get(_NAMES, "{}"))
    if isinstance(value, list):
        value = dict(enumerate(value))
    if isinstance(value, dict) and all(map(_is_number, value)):
        names = {int(number): name for number, name in value.items()}
        if all(isinstance(name, str) for name in names.values()) and len(names) == len(value):
            return names
    raise _fault(
        metadata, file, _NAMES, "{0: 'car', 1: 'truck'}", "state `class_names` in a YAML file"
    )


def keypoint_columns(metadata: Mapping[str, str], file: str) -> int:
    """Return how many numbers the keypoints of each object are, 0 for a network without keypoints.

    Raises:
        ModelError: the entry holds something else than their shape.
    """
    value = _literal(metadata.get(_KEYPOINTS, "[0, 2]"))
    is_shape = isinstance(value, list) and len(value) == 2  # points, numbers of each
    if is_shape and all(isinstance(n, int) and 0 <= n <= 1000 for n in value):
        return int(value[0] * value[1])
    raise _fault(
        metadata, file, _KEYPOINTS, "[17, 3]", "export the network again with its keypoints' shape"
    )


def _literal(text: str) -> Any:  # noqa: ANN401 - what the text says
    """Return the value of a literal, None for a text that is none."""
    if len(text) > _MAX_CHARACTERS:
        return None
    for read in (json.loads, ast.literal_eval):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of backslashes in names
                value = read(text)
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
            continue
        return list(value) if isinstance(value, tuple) else value
    return None


def _is_number(key: object) -> bool:
    text = str(key) if type(key) is int else key
    return isinstance(text, str) and text.isdecimal() and len(text) < 10


def _fault(
    metadata: Mapping[str, str], file: str, entry: str, example: str, advice: str
) -> ModelError:
    text = metadata[entry]
    shown = text if len(text) <= _SHOWN_CHARACTERS else f"{text[:_SHOWN_CHARACTERS]}..."
    return ModelError(
        f"{file}, metadata {entry}",
        expected=f"a literal such as {example}",
        found=shown,
        advice=advice,
    )
