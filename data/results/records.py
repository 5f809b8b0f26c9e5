"""JSON Lines: one record a line, whole after every frame, read back as the same dataclass."""

import dataclasses
import json
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from data.kitti.reading import read_text
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
    lines = read_text(path, LabelError, "a JSON Lines file").splitlines()
    return [_record(f"{path} line {n}", line, kind) for n, line in enumerate(lines, start=1)]


def read_json_lines(path: Path) -> list[dict[str, Any]]:
    """Read the objects of a JSON Lines file whose names are not known beforehand.

    Raises:
        LabelError: The file cannot be read, or a line is no JSON object.
    """
    lines = read_text(path, LabelError, "a JSON Lines file").splitlines()
    return [_object(f"{path} line {n}", line) for n, line in enumerate(lines, start=1)]


def read_record(path: Path, kind: type[Record]) -> Record:
    """Read a JSON document as an instance of a dataclass.

    Args:
        path: JSON file.
        kind: Dataclass of the document.

    Raises:
        LabelError: The file cannot be read, or is no document of this kind.
    """
    return _record(path, read_text(path, LabelError, "a JSON file"), kind)


def _object(where: str, text: str) -> dict[str, Any]:
    try:
        found: dict[str, Any] = dict(json.loads(text))
    except (TypeError, ValueError, RecursionError) as error:
        raise LabelError(where, expected="a JSON object", found=repr(text[:80])) from error
    return found


def _record(where: Path | str, text: str, kind: type[Record]) -> Record:
    try:
        record: Record = _parse(kind, json.loads(text))
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        found = repr(text[:80])
        raise LabelError(where, expected=f"a {kind.__name__}", found=found) from error
    return record


@cache
def _hints(kind: type) -> dict[str, Any]:
    """Return the types of the fields of a dataclass, which take longer to find than a line to read."""
    return get_type_hints(kind)


def _parse(kind: Any, value: Any) -> Any:  # noqa: ANN401 - follows any annotation
    if get_origin(kind) in (UnionType, Union):
        if value is None:
            return None
        (kind,) = (member for member in get_args(kind) if member is not NoneType)
    if dataclasses.is_dataclass(kind):
        # What an earlier version did not write has its default; a field without one is missed by the class.
        known = {name: hint for name, hint in _hints(kind).items() if name in value.keys()}  # type: ignore[arg-type]  # noqa: SIM118 - a list has none
        return kind(**{name: _parse(hint, value[name]) for name, hint in known.items()})  # type: ignore[operator]
    if get_origin(kind) is list:
        return [_parse(get_args(kind)[0], item) for item in value]
    if get_origin(kind) is dict:
        return {key: _parse(get_args(kind)[1], item) for key, item in value.items()}
    return kind(value) if isinstance(kind, type) and value is not None else value
