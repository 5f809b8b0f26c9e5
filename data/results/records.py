"""JSON Lines: one record a line, complete after every frame, read back as the same dataclass."""

import dataclasses
import json
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Self, TextIO, TypeVar, Union, get_args, get_origin, get_type_hints

from data.results.documents import to_serializable
from perception.errors import LabelError

Record = TypeVar("Record")


class LineFiles:
    """Text files of a folder that grow by whole lines, each complete after every frame; a context manager."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files: dict[str, TextIO] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        for file in self._files.values():
            file.close()

    def append(self, name: str, lines: str) -> None:
        """Append lines to a file, which replaces that of an earlier run.

        Args:
            name: Path of the file in the folder.
            lines: Whole lines, or none.
        """
        if name not in self._files:
            path = self._folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            self._files[name] = path.open("w")
        self._files[name].write(lines)
        self._files[name].flush()

    def append_record(self, name: str, record: object) -> None:
        """Append a dataclass to a JSON Lines file; its fields are the keys of the object."""
        self.append(name, json.dumps(to_serializable(record)) + "\n")

    def remove(self, name: str) -> None:
        """Remove the file of an earlier run."""
        (self._folder / name).unlink(missing_ok=True)


def read_records(path: Path, kind: type[Record]) -> list[Record]:
    """Read the lines of a file as instances of a dataclass.

    Args:
        path: JSON Lines file.
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
