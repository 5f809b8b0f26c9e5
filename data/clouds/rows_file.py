""".bin: rows of float32 numbers without names."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from data.clouds.cloud import COLUMNS, Cloud, cloud_of_rows
from data.clouds.file_bytes import read_scan_bytes
from data.kitti.sensor_files import SKIP_ADVICE
from perception.errors import ScanError
from perception.types import Float32

DEFAULT_COLUMNS = COLUMNS[:4]  # KITTI's
_PROBED_ROWS = 20_000


def read_rows_file(path: Path, columns: Sequence[str] | None = None) -> Cloud:
    """Read a .bin file.

    Args:
        path: File of float32 numbers.
        columns: Name of each column; else x, y, z, intensity.

    Raises:
        ScanError: The file does not hold a whole number of points.
    """
    names = columns or DEFAULT_COLUMNS
    data = read_scan_bytes(path)
    rest = len(data) % (4 * len(names))
    if rest:
        raise ScanError(
            path,
            expected=f"{4 * len(names)} bytes a point: {', '.join(names)} as float32",
            found=f"{len(data)} bytes, {rest} too many for a whole number",
            advice=f"name the columns with --columns; or copy the file again, it may be cut off; or {SKIP_ADVICE}",
        )
    return cloud_of_rows(np.frombuffer(data, np.float32).reshape(-1, len(names)), names, path)


def columns_in_rows(path: Path) -> int:
    """Return how many columns the rows of a .bin file have, 3 to 6, as neighbouring rows are alike.

    Raises:
        ScanError: The file cannot be read.
    """
    numbers = np.frombuffer(data := read_scan_bytes(path), np.float32, count=len(data) // 4)
    fitting = [count for count in range(3, 7) if len(data) % (4 * count) == 0]
    if not fitting or len(numbers) == 0:
        return len(DEFAULT_COLUMNS)
    return min(fitting, key=lambda count: _roughness(numbers, count))


def _roughness(numbers: Float32, count: int) -> float:
    """Return how far numbers are from those one row above, in comparison with those of one row beside each other."""
    rows = numbers.reshape(-1, count)[:_PROBED_ROWS].astype(np.float64)
    rows = rows[np.isfinite(rows).all(axis=1) & (np.abs(rows) < 1e10).all(axis=1)]
    if len(rows) < 2:
        return np.inf
    spread = np.median(np.abs(rows[:, :3] - np.median(rows[:, :3], axis=0)), axis=0) + 1e-6
    return float((np.median(np.abs(np.diff(rows[:, :3], axis=0)), axis=0) / spread).sum())
