"""Points as rows of numbers, behind the header of a .pcd or .ply."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from data.clouds.cloud import Table
from perception.errors import ScanError


def ascii_points(rows: Sequence[bytes], points: int, names: Sequence[str], path: Path) -> Table:
    """Return the columns by name.

    Args:
        rows: Lines that are not empty, one a point.
        points: Number of points as the header says.
        names: Names of the columns as the header says.
        path: Path of the file, for error messages.

    Raises:
        ScanError: They are no numbers, or others than the header says.
    """
    try:
        numbers = (
            np.loadtxt(rows, np.float64, comments=None, ndmin=2)
            if rows
            else np.zeros((0, len(names)))
        )
    except ValueError as error:
        found = str(error).rstrip(".")
        raise ScanError(path, expected="rows of numbers", found=found) from error
    if numbers.shape != (points, len(names)):
        raise ScanError(
            path,
            expected=f"{points} rows of {len(names)} numbers as its header says",
            found=f"{len(numbers)} rows of {numbers.shape[1]}",
        )
    return {name: numbers[:, place] for place, name in enumerate(names)}


def filled_rows(data: bytes) -> list[bytes]:
    """Return the lines of a text that are not empty."""
    return [line for line in data.splitlines() if line.strip()]
