"""A point cloud as a file holds it, and the names of its columns."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.errors import PerceptionError, ScanError
from perception.types import Float32, Float64, Int

# What other programs call a column. A first letter in capitals and the prefix of CloudCompare do not count.
_ALIASES = {
    "intensity": ("intensity", "reflectance", "reflectivity", "remission", "i", "r"),
    "ring": ("ring", "laser_number", "laser_id", "laser", "channel", "line", "beam"),
    "t": (
        "t", "time", "timestamp", "timestamps", "stamp", "offset_time", "time_offset", "offset",
        "point_time", "gps_time", "gpstime",
    ),
}  # fmt: skip
_UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
# A revolution takes 0.02 to 1 s; units are a factor of 1000 apart, so that the span tells the unit.
_SPAN_S = (0.005, 5.0)
COLUMNS = ("x", "y", "z", "intensity", "ring", "t")
IGNORED = "_"

Table = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class Cloud:
    """N points of one file, in the units and axes of the file.

    Attributes:
        xyz: (N, 3) coordinates.
        intensity: (N,) intensity or reflectance on the file's own scale, or None without it.
        ring: (N,) number of the beam, or None without it.
        times_s: (N,) time of each point in seconds, from an epoch or from the start of the scan, or None.
        viewpoint: (4, 4) pose of the sensor that the file states, or None for the identity.
    """

    xyz: Float32
    intensity: Float32 | None = None
    ring: Int | None = None
    times_s: Float64 | None = None
    viewpoint: Float64 | None = None

    def __len__(self) -> int:
        """Return N."""
        return len(self.xyz)


def cloud_of_columns(table: Table, source: str | Path) -> Cloud:
    """Return the cloud of columns by name.

    Args:
        table: (N,) columns by name; those that are not of a cloud are not used.
        source: File, for error messages.

    Raises:
        ScanError: x, y or z is missing.
    """
    known = {column: name for name in reversed(list(table)) if (column := column_of(name))}
    missing = [name for name in COLUMNS[:3] if name not in known]
    if missing:
        raise ScanError(
            source,
            expected="columns x, y and z",
            found=", ".join(map(str, table)) or "no columns",
            advice="name the columns in order with --columns, such as x,y,z,intensity,ring,t",
        )
    columns = {name: np.asarray(table[name]) for name in known.values()}
    shapes = {column.shape for column in columns.values()}
    are_numbers = all(column.dtype.kind in "fiub" for column in columns.values())
    if not are_numbers or len(shapes) > 1 or any(len(shape) != 1 for shape in shapes):
        found = [f"{name} {column.dtype} {column.shape}" for name, column in columns.items()]
        raise ScanError(
            source, expected="one number a point in each column", found=", ".join(found)
        )
    ring = table[known["ring"]] if "ring" in known else None
    return Cloud(
        xyz=np.column_stack([np.asarray(table[known[name]], np.float32) for name in "xyz"]),
        intensity=np.asarray(table[known["intensity"]], np.float32)
        if "intensity" in known
        else None,
        ring=None if ring is None else np.nan_to_num(ring, nan=-1).astype(np.int64),
        times_s=seconds_of(table[known["t"]], known["t"]) if "t" in known else None,
    )


def cloud_of_rows(rows: NDArray[Any], columns: Sequence[str] | None, source: str | Path) -> Cloud:
    """Return the cloud of (N, C) rows without names.

    Args:
        rows: Rows of the file.
        columns: Name of each column; else x, y, z, intensity, ring, t as far as there are columns.
        source: File, for error messages.

    Raises:
        ScanError: There are fewer than three columns, or other ones than are named.
    """
    count = rows.shape[1]
    if columns is None and not 3 <= count <= len(COLUMNS):
        raise ScanError(
            source,
            expected="3 to 6 columns, x y z intensity ring t in this order",
            found=f"{count} columns",
            advice="name the columns with --columns, and those that are not used _",
        )
    names = columns or COLUMNS[:count]
    return cloud_of_columns(
        named_columns([rows[:, k] for k in range(count)], names, source), source
    )


def named_columns(
    columns: Sequence[NDArray[Any]], names: Sequence[str], source: str | Path
) -> Table:
    """Give columns their names.

    Raises:
        ScanError: There are more or fewer names than columns.
    """
    if len(columns) != len(names):
        raise ScanError(
            source,
            expected=f"{len(names)} columns, {', '.join(names)}",
            found=f"{len(columns)}",
            advice="name every column with --columns, and those that are not used _",
        )
    return dict(zip(unique_names(names), columns, strict=True))


def unique_names(names: Sequence[str]) -> list[str]:
    """Return names of which none occurs twice: the columns that are not used get a number."""
    return [
        f"{name}{IGNORED}{place}" if name == IGNORED or name in names[:place] else name
        for place, name in enumerate(names)
    ]


def column_of(name: str) -> str | None:
    """Return which column of a cloud a file means by a name, or None where it is another one."""
    word = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_").removeprefix("scalar_")
    if word in COLUMNS:
        return word
    stem, _, unit = word.rpartition("_")
    stem = stem if unit in {*_UNITS_S, "m"} else word
    if stem in COLUMNS:
        return stem
    return next((column for column, words in _ALIASES.items() if stem in words), None)


def require_column_names(names: Sequence[str], where: str) -> None:
    """Validate names of columns: x, y and z at least, and no name that is not of a cloud.

    Raises:
        PerceptionError: A name is unknown, or one is missing or occurs twice.
    """
    known = [column_of(name) for name in names if name != IGNORED]
    if None in known or not {"x", "y", "z"} <= set(known) or len(set(known)) < len(known):
        raise PerceptionError(
            where,
            expected=f"each once of x, y, z and, where the file has them, {', '.join(COLUMNS[3:])}; _ for others",
            found=", ".join(names),
        )


def seconds_of(values: NDArray[Any], name: str = "t") -> Float64 | None:
    """Return times in seconds; None where no unit makes them the times of one scan.

    The unit is that in the name (`offset_ns`), else that by which the times span one turn of a LiDAR.

    Args:
        values: (N,) times in s, ms, us or ns.
        name: Name of the column.
    """
    unit = name.strip().lower().rpartition("_")[2]
    if unit in _UNITS_S:
        return np.asarray(values, np.float64) * _UNITS_S[unit]
    known = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    if len(known) == 0:
        return None
    # Integers are subtracted before they lose digits as floating-point numbers.
    span = float(known.max() - known.min())
    for scale in _UNITS_S.values():
        if _SPAN_S[0] <= span * scale <= _SPAN_S[1]:
            return np.asarray(values, np.float64) * scale
    return None
