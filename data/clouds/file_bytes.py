"""The contents of a cloud's file, and the bound on the memory that one scan may take."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from data.clouds.cloud import Table
from data.kitti.reading import read_bytes
from data.kitti.sensor_files import SKIP_ADVICE
from perception.errors import ScanError

# One turn of 128 beams with 4096 firings and two echoes of 64 bytes are 64 MiB.
MAX_SCAN_BYTES = 1 << 29


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


def read_scan_bytes(path: Path) -> bytes:
    """Return the contents of a scan's file.

    Raises:
        ScanError: The file is missing, cannot be read, or is larger than any scan.
    """
    try:
        size = path.stat().st_size
    except OSError:
        size = 0  # said where the file is read
    require_scan_size(size, path)
    return read_bytes(path, ScanError, "a scan", SKIP_ADVICE)


def require_scan_size(size: int, path: Path) -> None:
    """Validate the size of a scan in the file or after its decompression, before memory is taken for it.

    Raises:
        ScanError: It is larger than any scan.
    """
    if size > MAX_SCAN_BYTES:
        raise ScanError(
            path,
            expected=f"a scan of at most {MAX_SCAN_BYTES >> 20} MiB",
            found=f"{size >> 20} MiB",
            advice="write one turn of the LiDAR a file",
        )


def truncated_scan(path: Path, points: int, point_bytes: int, found: int) -> ScanError:
    """Return the error of a file that ends before the points that its header states."""
    return ScanError(
        path,
        expected=f"{points} points of {point_bytes} bytes as its header says, {points * point_bytes} bytes",
        found=f"{found} bytes",
        advice=f"copy the file again, it may be cut off; or {SKIP_ADVICE}",
    )
