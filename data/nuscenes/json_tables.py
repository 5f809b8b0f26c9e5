"""Tables of nuScenes: a JSON array of records a file, of which only the required ones are kept.

The tables of the whole set have a gigabyte and millions of records: a file is read piece by piece.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from perception.errors import DriveError

Record = dict[str, Any]
_PIECE_BYTES = 1 << 20
_MAX_RECORD_CHARS = 1 << 20  # one record has less than a thousand
_BLANKS = " \t\r\n,"


def read_records(
    path: Path, fields: Sequence[str], is_required: Callable[[Record], bool] | None = None
) -> list[Record]:
    """Read the records of a table that meet a condition.

    Args:
        path: File of the table.
        fields: Fields that every record must have.
        is_required: Condition; all records without one.

    Raises:
        DriveError: The file is missing or damaged, or a record lacks a field.
    """
    kept = []
    try:
        for record in _records(path):
            missing = [name for name in fields if not (isinstance(record, dict) and name in record)]
            if missing:
                raise DriveError(
                    path,
                    expected=f"records with {', '.join(fields)}",
                    found=f"one without {', '.join(missing)}",
                )
            if is_required is None or is_required(record):
                kept.append(record)
    except FileNotFoundError as error:
        raise DriveError(path, expected="a table of nuScenes", found="no file") from error
    except ValueError as error:
        raise DriveError(
            path,
            expected="a JSON array of records",
            found=str(error),
            advice="copy the file again, it may be cut off",
        ) from error
    return kept


def _records(path: Path) -> Iterator[Any]:
    """Yield the elements of a JSON array; raise ValueError where it is none, or is cut off."""
    decoder, text, place = json.JSONDecoder(), "", 0
    with path.open(encoding="utf-8") as file:
        if file.read(1) != "[":
            raise ValueError("another text than an array")
        while True:
            place = _skip_blanks(text, place)
            if place < len(text) and text[place] == "]":
                return
            try:
                record, place = decoder.raw_decode(text, place)
            except ValueError as error:
                more = file.read(_PIECE_BYTES)
                if not more or len(text) - place > _MAX_RECORD_CHARS:
                    raise ValueError(f"the array ends within a record: {error}") from error
                text, place = text[place:] + more, 0
                continue
            yield record


def _skip_blanks(text: str, place: int) -> int:
    while place < len(text) and text[place] in _BLANKS:
        place += 1
    return place
