"""Contents of files, with one error for every reason for which they cannot be read."""

from pathlib import Path

import numpy as np

from perception.errors import LabelError, PerceptionError
from perception.types import Float64

_FIRST_BYTES = 1 << 12  # in which the first row of a text is looked for


def read_bytes(
    path: Path, kind: type[PerceptionError], expected: str, advice: str | None = None
) -> bytes:
    """Return the contents of a file.

    Args:
        path: File to read.
        kind: Type of the error.
        expected: Content that is expected, for the error.
        advice: Remedy for the user, for the error.

    Raises:
        PerceptionError: The file is missing or cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        found = "no file" if missing else error.strerror or str(error)
        raise kind(path, expected=expected, found=found, advice=advice) from error


def read_text(
    path: Path, kind: type[PerceptionError], expected: str, advice: str | None = None
) -> str:
    """Return the contents of a text file; arguments and errors are those of `read_bytes`."""
    try:
        return read_bytes(path, kind, expected, advice).decode()
    except UnicodeDecodeError as error:
        raise kind(path, expected=expected, found=str(error), advice=advice) from error


def read_label_lines(path: Path, what: str = "a label text") -> list[str]:
    """Return the rows of a text file that are not blank.

    Raises:
        LabelError: The file cannot be read.
    """
    lines = read_text(path, LabelError, what).splitlines()
    return [line for line in lines if line.strip()]


def first_row(path: Path) -> str:
    """Return the first row of a text that is not blank, an empty one where there is none or it cannot be read."""
    try:
        with path.open("rb") as file:
            lines = file.read(_FIRST_BYTES).decode(errors="replace").splitlines()
    except OSError:
        return ""
    return next((line for line in lines if line.strip()), "")


def read_number_rows(path: Path, columns: int, kind: type[PerceptionError]) -> Float64:
    """Return the (R, columns) finite numbers of a text; blank rows do not count.

    Raises:
        PerceptionError: The file cannot be read, or a row holds other words or another number of them.
    """
    lines = read_text(path, kind, f"{columns} numbers a row").splitlines()
    rows = [line.split() for line in lines if line.strip()]
    for number, row in enumerate(rows, start=1):
        if len(row) != columns:
            found = f"{len(row)} words"
            raise kind(f"{path} row {number}", expected=f"{columns} numbers", found=found)
    try:
        numbers = np.array(rows, np.float64).reshape(-1, columns)
    except ValueError as error:
        raise kind(path, expected=f"{columns} numbers a row", found=str(error)) from error
    if not np.isfinite(numbers).all():
        number = int(np.isfinite(numbers).all(axis=1).argmin()) + 1
        expected = f"{columns} finite numbers"
        raise kind(f"{path} row {number}", expected=expected, found="NaN or infinity")
    return numbers
