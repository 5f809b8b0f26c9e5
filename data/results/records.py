"""JSON Lines: one record a line, whole after every frame, read back as the same dataclass."""

import dataclasses
import json
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from data.results.documents import to_serializable
from perception.atomic_file import append_atomically
from perception.errors import LabelError

Record = TypeVar("Record")


def append_record(path: Path, record: object) -> None:
    """Append a dataclass to a JSON Lines file; its fields are the keys of the object."""
    append_atomically(path, f"{json.dumps(to_serializable(record))}\n".encode())


def read_records(path: Path, kind: type[Record]) -> list[Record]:
    """Read the lines of a file as instances of a dataclass.

    Args:
        path: JSON Lines file.
        kind: Dataclass of a line.

    Raises:
        LabelError: The file cannot be read, or a line is no record of this kind.
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
