"""Times of files: in a file beside them, or in their names. Whole nanoseconds, which floating-point seconds do not hold."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from data.kitti.reading import read_text
from perception.errors import DriveError
from perception.types import Int

# Seconds since 1970 with a fraction behind them: 1317036272.123456 or 1317036272_123456789.
_SECONDS = re.compile(r"(?:.*[^0-9])?([0-9]{9,10})[._-]([0-9]{3,9})")
_WHOLE = re.compile(r"(?:.*[^0-9])?([0-9]{13}|[0-9]{16}|[0-9]{18,19})")
_UNIT_NS = {13: 1_000_000, 16: 1_000, 18: 1, 19: 1}  # 18 where nanoseconds are from 1980 on
_MAX_NS = 2**63
_NUMBER = re.compile(r"-?([0-9]+)(?:\.([0-9]*))?(?:[eE][+-]?[0-9]+)?")


def stamps_in_names(paths: Sequence[Path]) -> Int | None:
    """Return (F,) Unix times in nanoseconds that all files are named by, or None."""
    stamps = [_stamp_in_name(path.stem) for path in paths]
    known = [one for one in stamps if one is not None]
    return np.array(known, np.int64) if known and len(known) == len(stamps) else None


def _stamp_in_name(stem: str) -> int | None:
    if whole := _WHOLE.fullmatch(stem):
        return int(whole[1]) * _UNIT_NS[len(whole[1])]
    if parts := _SECONDS.fullmatch(stem):
        return int(parts[1]) * 1_000_000_000 + int(parts[2].ljust(9, "0"))
    return None


def read_stamps(path: Path, count: int) -> Int:
    """Read (F,) times in nanoseconds, a row a file: seconds, whole ms, us or ns since 1970, or a date and time.

    Args:
        path: File of one time a row; of several columns, separated by commas or blanks, the last number counts.
        count: Number of files, F.

    Raises:
        DriveError: A row is no time, or there are more or fewer rows than files.
    """
    lines = [
        line
        for line in read_text(path, DriveError, "timestamps as text").splitlines()
        if line.strip()
    ]
    if len(lines) == count + 1 and parse_stamp(lines[0]) is None:
        lines = lines[1:]  # names of the columns
    stamps = [parse_stamp(line) for line in lines]
    if None in stamps:
        raise DriveError(
            f"{path} row {stamps.index(None) + 1}",
            expected="a time, as 1317036272.123456 or 2011-09-26 13:04:32.335337762",
            found=lines[stamps.index(None)][:80],
        )
    if len(stamps) != count:
        raise DriveError(path, expected=f"{count} rows, one a file", found=str(len(stamps)))
    return np.array(stamps, np.int64)


def parse_stamp(text: str) -> int | None:
    """Return the nanoseconds of a row, or None where it is no time."""
    stamp_ns = _parse(text.replace(",", " ").replace(";", " ").split())
    return stamp_ns if stamp_ns is not None and abs(stamp_ns) < _MAX_NS else None


def _parse(words: list[str]) -> int | None:
    number = _NUMBER.fullmatch(words[-1]) if words else None
    try:
        if number is None:
            return _parse_date(" ".join(words))
        if number[2] is None and "e" not in words[-1].lower():
            return int(words[-1]) * _whole_unit_ns(len(number[1]))
        return _parse_seconds(words[-1])
    except (ValueError, OverflowError):
        return None


def _whole_unit_ns(digits: int) -> int:
    """Return the unit of a whole number: seconds up to 10 digits, then ms, us and ns."""
    return next(
        (unit for most, unit in ((10, 10**9), (13, 10**6), (16, 10**3)) if digits <= most), 1
    )


def _parse_seconds(word: str) -> int:
    if "e" in word.lower():
        return round(float(word) * 1e9)
    whole, _, fraction = word.partition(".")
    sign = -1 if whole.startswith("-") else 1
    return int(whole or 0) * 10**9 + sign * int(fraction[:9].ljust(9, "0"))


def _parse_date(text: str) -> int:
    head, dot, fraction = text.strip().rstrip("Z").partition(".")
    moment = datetime.fromisoformat(head).replace(tzinfo=UTC)
    return int(moment.timestamp()) * 10**9 + (int(fraction[:9].ljust(9, "0")) if dot else 0)
