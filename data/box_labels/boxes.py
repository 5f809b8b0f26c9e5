"""Labelled boxes of a file as it states them, and the parts of its numbers, each fault one sentence."""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from data.kitti.reading import read_text
from perception.atomic_file import write_atomically
from perception.errors import LabelError
from perception.json_text import RepeatedKeyError, read_json_text
from perception.types import Float64

Record = Mapping[str, Any]
_MAX_M = 1e5


@dataclass(frozen=True)
class LabelledBox:
    """One box of one frame.

    Attributes:
        where: File and object, for error messages.
        kind: Class as the file names it.
        track: Id of the object, empty without one.
        numbers: Place x, y, z, lengths along the axes x, y, z of the box, and heading, as a reading of the form means them.
    """

    where: str
    kind: str
    track: str
    numbers: tuple[float, ...]

    def __post_init__(self) -> None:
        """Validate that the numbers are finite, and the lengths above 0."""
        if not (all(map(math.isfinite, self.numbers)) and max(map(abs, self.numbers)) < _MAX_M):
            shown = ", ".join(f"{one:g}" for one in self.numbers)
            raise LabelError(self.where, expected="finite numbers of a box", found=shown)
        if min(self.numbers[3:6]) <= 0:
            sizes = " x ".join(f"{one:g}" for one in self.numbers[3:6])
            advice = "correct or remove it in the labelling tool"
            raise LabelError(
                self.where, expected="a box with sizes above 0", found=sizes, advice=advice
            )


@dataclass(frozen=True)
class Reading:
    """One of the ways in which the numbers of a form may be meant.

    Attributes:
        name: Meaning in a few words.
        boxes: Function from (M, 7) numbers of boxes to such of centres in metres, of lengths along and across the heading
            and upwards, and of headings in rad from +x towards +y, in the axes of the scans.
    """

    name: str
    boxes: Callable[[Float64], Float64]


Frames = Mapping[str, Sequence[LabelledBox]]


@dataclass(frozen=True)
class LabelledFrame:
    """A frame to be written with its boxes.

    Attributes:
        name: Name of the scan, as its file is named without the suffix.
        number: Number of the frame.
        scan: Name of the file of the scan.
        boxes: Boxes of objects: centre, lengths along and across the heading and upwards, heading in rad, in the axes of the scan.
        world_SE3_file: (4, 4) pose of the scan.
        stamp_us: Time of the scan in microseconds.
        image: Name of the file of the image, None without one.
        size_px: Width and height of the image.
        image_boxes: Boxes in the image: shares of x and y of the centre, 0, of width and height, 1 and 0.
    """

    name: str
    number: int
    scan: str
    boxes: Sequence[LabelledBox]
    world_SE3_file: Float64 = field(default_factory=lambda: np.eye(4))
    stamp_us: int = 0
    image: str | None = None
    size_px: tuple[int, int] = (0, 0)
    image_boxes: Sequence[LabelledBox] = ()


Write = Callable[[Path, Sequence[LabelledFrame]], None]


@dataclass(frozen=True)
class LabelForm:
    """Form of labels.

    Attributes:
        name: Name of the tool or the standard.
        is_of: Whether the parsed content of a file is of the form: a document of JSON, or the text.
        read: Function from a file and its content to the boxes by frame: the name, or the number in digits, of a scan.
        readings: Ways in which the numbers may be meant, the usual one first.
        write: Function that writes frames into a folder.
        is_per_scan: Whether a file holds one scan, after which it is named; its frame is then "".
        names_frames: Whether frames without a box are named, too; others are then not labelled.
        is_of_image: Whether boxes are those of images, by whose names frames are called.
    """

    name: str
    is_of: Callable[[Any], bool]
    read: Callable[[Path, Any], Frames]
    readings: tuple[Reading, ...]
    write: Write
    is_per_scan: bool = False
    names_frames: bool = False
    is_of_image: bool = False


def as_stated(numbers: Float64) -> Float64:
    """Return boxes that are stated as `Reading` has them."""
    return numbers


def along_y(numbers: Float64) -> Float64:
    """Return boxes whose heading is the y axis of the box."""
    return np.column_stack([numbers[:, :3], numbers[:, [4, 3, 5]], numbers[:, 6] + np.pi / 2])


def from_bottom(numbers: Float64) -> Float64:
    """Return boxes whose z is that of the bottom."""
    return np.column_stack([numbers[:, :2], numbers[:, 2] + numbers[:, 5] / 2, numbers[:, 3:]])


def in_degrees(numbers: Float64) -> Float64:
    """Return boxes whose headings are in degrees."""
    return np.column_stack([numbers[:, :6], np.radians(numbers[:, 6])])


AXES = (Reading("x forward", as_stated), Reading("y forward", along_y))


def read_content(path: Path) -> Any:  # noqa: ANN401 - any document
    """Return the document of a JSON file, or the text of another.

    Raises:
        LabelError: The file cannot be read, is no JSON, or has a key twice.
    """
    text = read_text(path, LabelError, "labels as text")
    if path.suffix.lower() != ".json":
        return text
    try:
        return read_json_text(text)
    except RepeatedKeyError as error:
        raise LabelError(path, expected="each id once", found=str(error)) from error
    except ValueError as error:
        advice = "export it again, it may be cut off"
        raise LabelError(path, expected="JSON", found=str(error), advice=advice) from error


def entry(record: object, name: str | int, where: str) -> Any:  # noqa: ANN401 - of any kind
    """Return the value of a name in a record, or at a place in a list.

    Raises:
        LabelError: There is none.
    """
    try:
        value = record[name]  # type: ignore[index]
    except (KeyError, IndexError, TypeError):
        value = None
    if value is None:
        found = ", ".join(map(str, record)) if isinstance(record, Mapping) else _kind(record)
        raise LabelError(where, expected=f"an entry {name!r}", found=found[:80] or "none")
    return value


def numbers_of(record: object, names: Sequence[str | int], where: str) -> tuple[float, ...]:
    """Return the numbers of some names in a record, or of some places in a list.

    Raises:
        LabelError: One is missing, or is no number.
    """
    values = [entry(record, name, where) for name in names]
    try:
        return tuple(map(float, values))
    except (TypeError, ValueError) as error:
        expected = f"numbers {', '.join(map(str, names))}"
        raise LabelError(where, expected=expected, found=str(values)[:80]) from error


def numbers_in(
    record: object, fields: Mapping[str, Sequence[str | int]], where: str
) -> tuple[float, ...]:
    """Return the numbers of the parts of a record, such as place, lengths and turns, one part after the other.

    Raises:
        LabelError: One is missing, or is no number.
    """
    parts = ((entry(record, part, where), names) for part, names in fields.items())
    return tuple(value for part, names in parts for value in numbers_of(part, names, where))


def named(names: str, values: Iterable[float]) -> dict[str, float]:
    """Return rounded numbers by names that blanks divide."""
    return dict(zip(names.split(), rounded(values), strict=True))


def rounded(values: Iterable[float]) -> list[float]:
    """Return numbers to a tenth of a millimetre, or so of a rad."""
    return [round(float(one), 4) + 0.0 for one in values]


def write_document(path: Path, document: object) -> None:
    """Write a JSON document, or a text."""
    text = document if isinstance(document, str) else json.dumps(document, indent=1)
    write_atomically(path, text.encode())


def track_name(track: object) -> str:
    """Return the id of an object as text, empty without one."""
    return "" if track is None else str(track)


def records(document: object, name: str, where: str | Path) -> list[Any]:
    """Return the list of records of a name in a document.

    Raises:
        LabelError: There is no list, or something else in it.
    """
    found = entry(document, name, str(where))
    if not isinstance(found, list):
        raise LabelError(where, expected=f"a list {name}", found=_kind(found))
    return [as_record(one, f"{where} {name} {row}") for row, one in enumerate(found, start=1)]


def as_record(value: object, where: str | Path) -> Record:
    """Return a value that is a record, as it is.

    Raises:
        LabelError: It is something else.
    """
    if not isinstance(value, Mapping):
        raise LabelError(where, expected="a record of names and values", found=_kind(value))
    return value


def _kind(value: object) -> str:
    return f"a list of {len(value)}" if isinstance(value, list) else type(value).__name__


def has(document: object, *names: str) -> bool:
    """Return whether a document is a record with some names."""
    return isinstance(document, Mapping) and all(name in document for name in names)
