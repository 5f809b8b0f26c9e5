"""Times of the files of one sensor: rows of KITTI's timestamps.txt, or Unix times in the names of the files."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from data.kitti.reading import read_text
from data.kitti.sensor_files import FrameFiles
from perception.errors import DriveError
from perception.types import Float64

# A date, a time to nanoseconds with any digits behind them, and a time zone; UTC where none is stated.
_TIME = re.compile(
    r"([0-9]{4}-[0-9]{2}-[0-9]{2}(?:[ T][0-9]{2}(?::[0-9]{2}(?::[0-9]{2})?)?)?)"
    r"(?:(\.[0-9]{1,9})[0-9]*)? ?(?:Z|([+-])([0-9]{2}):?([0-9]{2})?)?"
)
_YEARS = range(1678, 2262)  # that nanoseconds in 64 bits hold
Times = NDArray[np.datetime64]  # in ns, NaT where unknown


def read_timestamps(path: Path) -> Times:
    """Read (R,) times in UTC, one a row; NaT for a row that is no time.

    Raises:
        DriveError: The file is not text.
    """
    lines = read_text(path, DriveError, "timestamps as text").splitlines()
    return np.array([_parse_timestamp(line) for line in lines], "datetime64[ns]")


def timestamp_rows(timestamps: Times, files: FrameFiles) -> tuple[int, ...]:
    """Return the row of each file: a row a file; or, where files are missing, a row for each number from 0 or the first."""
    numbers = files.numbers
    if len(timestamps) == len(files):
        return tuple(range(len(files)))
    is_from_first = len(files) > 0 and len(timestamps) == numbers[-1] - numbers[0] + 1
    return tuple(number - numbers[0] for number in numbers) if is_from_first else numbers


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
    match = _TIME.fullmatch(line.strip())
    if match is None or int(line.strip()[:4]) not in _YEARS:
        return np.datetime64("NaT", "ns")
    time, fraction, sign, hours, minutes = match.groups("")
    ahead_min = 60 * int(hours or 0) + int(minutes or 0)
    try:  # without the zone: NumPy reads it, too, but warns of each
        local = np.datetime64(time + fraction, "ns")
    except ValueError:  # no such day or hour
        return np.datetime64("NaT", "ns")
    return local - np.timedelta64(-ahead_min if sign == "-" else ahead_min, "m")
