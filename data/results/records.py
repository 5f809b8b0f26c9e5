"""JSON Lines: one record a line, whole after every frame, read back as the same dataclass."""

import dataclasses
import json
from collections.abc import Callable, Hashable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

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


class FrameRecords(Mapping[int, Record]):
    """The records of a file by the index of their frame, read when they are asked for: a long run has gigabytes."""

    def __init__(self, path: Path, kind: type[Record]) -> None:
        """Find the line of each frame.

        Args:
            path: JSON Lines file; without it there are no records.
            kind: Dataclass of a line, with a field `frame`.

        Raises:
            LabelError: The file cannot be read, or a line is no JSON object of a frame.
        """
        self._path, self._kind = path, kind
        self._places: dict[int, tuple[int, int]] = {}  # start and length in bytes
        if not path.exists():
            return
        try:
            with path.open("rb") as file:
                start = 0
                for number, line in enumerate(file, start=1):
                    found = _object(f"{path} line {number}", line.decode(errors="replace"))
                    self._places[_frame(f"{path} line {number}", found)] = start, len(line)
                    start += len(line)
        except OSError as error:
            raise LabelError(path, expected="a JSON Lines file", found=str(error)) from error

    def __getitem__(self, frame: int) -> Record:
        """Read the record of a frame.

        Raises:
            LabelError: The line is no record of this kind.
        """
        start, length = self._places[frame]
        with self._path.open("rb") as file:
            file.seek(start)
            line = file.read(length)
        where = f"{self._path} frame {frame}"
        return _record(where, line.decode(errors="replace"), self._kind)

    def __iter__(self) -> Iterator[int]:
        """Yield the frames in the order of the file."""
        return iter(self._places)

    def __contains__(self, frame: object) -> bool:
        """Return whether there is a record of a frame, without reading it."""
        return frame in self._places

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._places)


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


def _frame(where: str, found: Mapping[str, Any]) -> int:
    frame = found.get("frame")
    if not isinstance(frame, int):
        raise LabelError(where, expected="the index of a frame", found=repr(frame))
    return frame


def _record(where: Path | str, text: str, kind: type[Record]) -> Record:
    try:
        record: Record = _reader(cast("Hashable", kind))(json.loads(text))
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        found = repr(text[:80])
        raise LabelError(where, expected=f"a {kind.__name__}", found=found) from error
    return record


@cache
def _reader(kind: Any) -> Callable[[Any], Any]:  # noqa: ANN401 - follows any annotation
    """Return a function that reads a JSON value as a type; made once, as a run has millions of values."""
    if get_origin(kind) in (UnionType, Union):
        (member,) = (one for one in get_args(kind) if one is not NoneType)
        read_member = _reader(member)
        return lambda value: None if value is None else read_member(value)
    if dataclasses.is_dataclass(kind):
        make: Callable[..., Any] = cast("type[Any]", kind)
        readers = {name: _reader(hint) for name, hint in get_type_hints(kind).items()}

        def read_fields(value: Any) -> Any:  # noqa: ANN401 - a JSON value
            # What an earlier version did not write has its default; a field without one is missed by the class.
            names = value.keys()
            return make(**{one: read(value[one]) for one, read in readers.items() if one in names})

        return read_fields
    if get_origin(kind) is list:
        read_item = _reader(get_args(kind)[0])
        return lambda value: [read_item(item) for item in value]
    if get_origin(kind) is dict:
        read_item = _reader(get_args(kind)[1])
        return lambda value: {key: read_item(item) for key, item in value.items()}
    if isinstance(kind, type):
        return lambda value: None if value is None else kind(value)
    return lambda value: value
