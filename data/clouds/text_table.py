"""Tables as text: a row of numbers a line, with or without a row of names; commas, semicolons, tabs or blanks between."""

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.clouds.cloud import Cloud, cloud_of_columns, cloud_of_rows, named_columns
from data.clouds.file_bytes import read_scan_bytes
from perception.errors import PerceptionError, ScanError
from perception.types import Float64

_COMMENT = re.compile(r"^\s*(#|//)\s*")


@dataclass(frozen=True)
class TextTable:
    """Rows of numbers, and the names of their columns.

    Attributes:
        names: Names in the order of the columns; none where the file has no row of names.
        rows: (N, C) numbers.
    """

    names: tuple[str, ...]
    rows: Float64


def read_csv(path: Path, columns: Sequence[str] | None = None) -> Cloud:
    """Read a .csv file of points.

    Args:
        path: File of a row a point.
        columns: Name of each column in place of the file's.

    Raises:
        ScanError: The file is no table of numbers, or lacks x, y or z.
    """
    table = parse_text_table(read_scan_bytes(path), path, ScanError)
    names = columns or table.names
    if not names:
        return cloud_of_rows(table.rows, None, path)
    return cloud_of_columns(named_columns(list(table.rows.T), names, path), path)


def parse_text_table(
    data: bytes, source: str | Path, kind: type[PerceptionError] = PerceptionError
) -> TextTable:
    """Return the table in the bytes of a file.

    Args:
        data: Contents of the file.
        source: File, for error messages.
        kind: Type of the error.

    Raises:
        PerceptionError: It is no table of numbers.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise kind(source, expected="a table as text", found=str(error)) from error
    # The names are in the last comment, unless it is another text, or in the first line below.
    lines, first = text.strip().splitlines(), 0
    names: tuple[str, ...] = ()
    while first < len(lines) and (mark := _COMMENT.match(lines[first])):
        names, first = tuple(_words(lines[first][mark.end() :])), first + 1
    has_name_row = first < len(lines) and not _is_numbers(lines[first])
    if has_name_row:
        names, first = tuple(_words(lines[first])), first + 1
    delimiter = next((one for one in ",;\t" if first < len(lines) and one in lines[first]), None)
    numbers = io.StringIO("\n".join(lines[first:]))
    try:
        rows = (
            np.loadtxt(numbers, np.float64, delimiter=delimiter, ndmin=2)
            if first < len(lines)
            else np.zeros((0, 0))
        )
    except ValueError as error:
        raise kind(source, expected="rows of numbers", found=str(error).rstrip(".")) from error
    if not has_name_row and len(names) != rows.shape[1]:
        names = ()
    if len(rows) == 0 or (names and len(names) != rows.shape[1]):
        found = f"{len(names)} names and {len(rows)} rows of {rows.shape[1]} numbers"
        raise kind(source, expected="rows of numbers, and a name for each column", found=found)
    return TextTable(names, rows)


def _words(line: str) -> list[str]:
    delimiter = next((one for one in ",;\t" if one in line), None)
    return [word.strip().strip('"') for word in line.split(delimiter)]


def _is_numbers(line: str) -> bool:
    try:
        [float(word) for word in _words(line)]
    except ValueError:
        return False
    return True
