"""Times of the files of one sensor: rows of KITTI's timestamps.txt, or Unix times in the names of the files."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from data.kitti.reading import read_text
from data.kitti.sensor_files import FrameFiles
from perception.errors import DriveError
from perception.types import Float64

Times = NDArray[np.datetime64]  # in ns, NaT where unknown


def read_timestamps(path: Path) -> Times:
    """Read (R,) times, one a row; NaT for a row that is no time.

    Raises:
        DriveError: The file is not text.
    """
    lines = read_text(path, DriveError, "timestamps as text").splitlines()
    return np.array([_parse_timestamp(line) for line in lines], "datetime64[ns]")


def timestamp_rows(timestamps: Times, files: FrameFiles) -> tuple[int, ...]:
    """Return the row of each file: a row a file; or, where files are missing, a row for each number."""
    return tuple(range(len(files))) if len(timestamps) == len(files) else files.numbers


def file_times(path: Path, files: FrameFiles) -> Times | None:
    """Return the (F,) times of files by their timestamps, else by their names; None where neither tells.

    Raises:
        DriveError: The timestamps are not text.
    """
    if not path.is_file():
        return files.unix_times
    timestamps = read_timestamps(path)
    rows = np.array(timestamp_rows(timestamps, files), np.int64)
    padded = np.append(timestamps, np.datetime64("NaT", "ns"))
    return np.asarray(padded[np.minimum(rows, len(timestamps))])


def seconds_since(times: Times, origin: np.datetime64) -> Float64:
    """Return (F,) seconds since a time, NaN where unknown."""
    return np.asarray((times - origin) / np.timedelta64(1, "s"), np.float64)


def first_known(times: Times) -> np.datetime64:
    """Return the first time that is known, or that of the epoch."""
    known = times[~np.isnat(times)]
    return known[0] if len(known) else np.datetime64("1970-01-01", "ns")


def _parse_timestamp(line: str) -> np.datetime64:
    try:
        return np.datetime64(line.strip() or "NaT", "ns")
    except ValueError:
        return np.datetime64("NaT", "ns")
