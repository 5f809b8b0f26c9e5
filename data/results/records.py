"""JSON Lines: one record a line, complete after every frame, read back as the same dataclass."""

import dataclasses
import json
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Self, TextIO, TypeVar, Union, get_args, get_origin, get_type_hints

from data.results.documents import to_serializable
from perception.errors import LabelError

Record = TypeVar("Record")


class RecordWriter:
    """Writes a dataclass a line; a context manager.

    The fields of the dataclass are the keys of the JSON object.
    """

    def __init__(self, path: Path) -> None:
        """Open the file and make its folder.

        Args:
            path: File to write, such as `tracks.jsonl`.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        # Line buffering: what was written before an interruption can be read.
        self._lines: TextIO = path.open("w", buffering=1)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._lines.close()

    def write(self, record: object) -> None:
        """Write one line.

        Args:
            record: Instance of a dataclass.
        """
        self._lines.write(json.dumps(to_serializable(record)) + "\n")


def read_records(path: Path, kind: type[Record]) -> list[Record]:
    """Read the lines of a file as instances of a dataclass.

    Args:
        path: File that a `RecordWriter` wrote.
        kind: Dataclass of a line.

    Raises:
        LabelError: the file cannot be read, or a line is no record of this kind.
    """
    try:
        lines = path.read_text().splitlines()
    except OSError as error:
        raise LabelError(path, expected="a JSON Lines file", found=str(error.strerror)) from error
    records = []
    for number, line in enumerate(lines, start=1):
        try:
            records.append(_parse(kind, json.loads(line)))
        except (KeyError, TypeError, ValueError) as error:
            raise LabelError(
                f"{path} line {number}", expected=f"a {kind.__name__}", found=repr(line[:80])
            ) from error
    return records


def _parse(kind: Any, value: Any) -> Any:  # noqa: ANN401 - follows any annotation
    if get_origin(kind) in (UnionType, Union):
        if value is None:
            return None
        (kind,) = (member for member in get_args(kind) if member is not NoneType)
    if dataclasses.is_dataclass(kind):
        hints = get_type_hints(kind)
        return kind(**{name: _parse(hint, value[name]) for name, hint in hints.items()})  # type: ignore[operator]
    if get_origin(kind) is list:
        return [_parse(get_args(kind)[0], item) for item in value]
    if get_origin(kind) is dict:
        return {key: _parse(get_args(kind)[1], item) for key, item in value.items()}
    return kind(value) if isinstance(kind, type) and value is not None else value
