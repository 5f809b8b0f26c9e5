"""Rows of timestamps.txt: zones, digits beyond nanoseconds, and rows that are no time."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from data.kitti.sensor_files import FrameFiles
from data.kitti.timestamps import read_timestamps, timestamp_rows

NOON = "2011-09-26T12:00:00"


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("2011-09-26 12:00:00.123456789", f"{NOON}.123456789"),
        ("2011-09-26 12:00:00.1234567891234567890123", f"{NOON}.123456789"),
        ("2011-09-26T12:00:00Z", NOON),
        ("2011-09-26 14:00:00+02:00", NOON),
        ("2011-09-26 08:30:00 -0330", NOON),
        ("2011-09-26 13:00+01", NOON),
        ("2011-09-26", "2011-09-26T00:00:00"),
        ("2261-12-31 23:59:59", "2261-12-31T23:59:59"),
        ("2262-01-01 00:00:00", "NaT"),  # nanoseconds would wrap around
        ("9999-01-01 00:00:00", "NaT"),
        ("2011-02-30 12:00:00", "NaT"),
        ("2011-09-26 25:00:00", "NaT"),
        ("now", "NaT"),
        ("", "NaT"),
    ],
)
def test_a_row_is_a_time_in_utc_or_unknown(row, expected, tmp_path):
    path = tmp_path / "timestamps.txt"
    path.write_text(f"{row}\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (found,) = read_timestamps(path)
    np.testing.assert_array_equal(found, np.datetime64(expected, "ns"))


@pytest.mark.parametrize(
    ("numbers", "rows", "expected"),
    [
        ((0, 1, 2), 3, (0, 1, 2)),
        ((4, 6, 7), 3, (0, 1, 2)),  # a row a file
        ((4, 6, 7), 8, (4, 6, 7)),  # a row for each number from 0
        ((4, 6, 7), 4, (0, 2, 3)),  # a row for each number from the first
        ((4, 6, 7), 6, (4, 6, 7)),  # rows are missing
        ((), 5, ()),
    ],
)
def test_the_row_of_each_file(numbers, rows, expected):
    files = FrameFiles(Path("data"), tuple(Path(f"data/{number:010d}.bin") for number in numbers))
    assert timestamp_rows(np.zeros(rows, "datetime64[ns]"), files) == expected
