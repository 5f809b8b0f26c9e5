""".pcd of the Point Cloud Library: ascii, binary, and binary compressed by LZF."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data.clouds.cloud import Cloud, Table, cloud_of_columns, named_columns, unique_names
from data.clouds.file_bytes import (
    ascii_points,
    filled_rows,
    read_scan_bytes,
    require_scan_size,
    truncated_scan,
)
from perception.errors import ScanError

_MAX_HEADER_BYTES = 1 << 14
_KINDS = {"F": "f", "I": "i", "U": "u"}
_KEYS = {"FIELDS", "SIZE", "TYPE", "WIDTH", "HEIGHT", "DATA"}
_FORMS = ("ascii", "binary", "binary_compressed")


@dataclass(frozen=True)
class _Header:
    """What the text at the start of a file states.

    Attributes:
        dtype: Type of one point, with a field for each column.
        points: Number of points.
        form: Form of the data: ascii, binary or binary_compressed.
        end: Number of bytes of the header.
    """

    dtype: np.dtype[Any]
    points: int
    form: str
    end: int

    @property
    def size(self) -> int:
        """Bytes of all points."""
        return self.points * self.dtype.itemsize


def read_pcd(path: Path, columns: Sequence[str] | None = None) -> Cloud:
    """Read a .pcd file.

    Args:
        path: File of one cloud, organised or not.
        columns: Name of each field in place of the file's.

    Raises:
        ScanError: The header or the data are malformed, or there is less data than the header states.
    """
    data = read_scan_bytes(path)
    header = _parse_header(data, path)
    require_scan_size(header.size, path)
    read = {"ascii": _ascii, "binary": _binary, "binary_compressed": _compressed}[header.form]
    table = read(data[header.end :], header, path)
    return cloud_of_columns(
        named_columns(list(table.values()), columns, path) if columns else table, path
    )


def _parse_header(data: bytes, path: Path) -> _Header:
    rows: dict[str, list[str]] = {}
    file = io.BytesIO(data[:_MAX_HEADER_BYTES])
    while "DATA" not in rows and (line := file.readline()):
        words = line.decode("latin1").split("#")[0].split()
        if words:
            rows[words[0].upper()] = words[1:]
    if missing := sorted(_KEYS - rows.keys()):
        raise ScanError(
            path, expected="the header of a PCD file", found=f"none of {', '.join(missing)}"
        )
    try:
        dtype, points = _point_type(rows), int(rows["WIDTH"][0]) * int(rows["HEIGHT"][0])
        stated, form = int(rows.get("POINTS", [str(points)])[0]), rows["DATA"][0].lower()
    except (ValueError, IndexError, KeyError, TypeError) as error:
        raise ScanError(
            path,
            expected="a PCD header with a SIZE, a TYPE and a COUNT for each of its FIELDS",
            found=f"one that does not fit together ({error})",
        ) from error
    if stated != points or points < 0 or form not in _FORMS:
        raise ScanError(
            path,
            expected=f"WIDTH times HEIGHT points, and DATA of {', '.join(_FORMS)}",
            found=f"POINTS {stated}, WIDTH times HEIGHT {points}, DATA {form}",
        )
    return _Header(dtype, points, form, file.tell())


def _point_type(rows: Mapping[str, list[str]]) -> np.dtype[Any]:
    names = unique_names(rows["FIELDS"])
    counts = list(map(int, rows.get("COUNT", ["1"] * len(names))))
    fields: list[Any] = []
    for name, kind, size, count in zip(names, rows["TYPE"], rows["SIZE"], counts, strict=True):
        if count < 1:
            raise ValueError(f"COUNT {count}")
        one = np.dtype(f"<{_KINDS[kind.upper()]}{int(size)}")
        fields.append((name, one) if count == 1 else (name, one, (count,)))
    return np.dtype(fields)


def _first(values: NDArray[Any]) -> NDArray[Any]:
    """Return one number a point of a field that may hold several."""
    return values if values.ndim == 1 else values[:, 0]


def _binary(data: bytes, header: _Header, path: Path) -> Table:
    if len(data) < header.size:
        raise truncated_scan(path, header.points, header.dtype.itemsize, len(data))
    points = np.frombuffer(data, header.dtype, count=header.points)
    return {name: _first(points[name]) for name in header.dtype.names or ()}


def _compressed(data: bytes, header: _Header, path: Path) -> Table:
    """Decompress the columns, which lie one behind the other."""
    import lzf

    sizes = np.frombuffer(data[:8], np.uint32) if len(data) >= 8 else np.zeros(2, np.uint32)
    packed, size = int(sizes[0]), int(sizes[1])
    if size != header.size or len(data) < 8 + packed:
        raise truncated_scan(path, header.points, header.dtype.itemsize, min(size, len(data)))
    try:
        unpacked = lzf.decompress(data[8 : 8 + packed], size) if size else b""
    except ValueError as error:
        raise ScanError(path, expected="data compressed by LZF", found=str(error)) from error
    if unpacked is None or len(unpacked) != size:
        raise ScanError(path, expected=f"{size} bytes compressed by LZF", found="other data")
    table, start = {}, 0
    for name in header.dtype.names or ():
        field = header.dtype[name]
        column = np.frombuffer(
            unpacked, field.base, header.points * int(np.prod(field.shape)), start
        )
        table[name] = _first(column.reshape(header.points, *field.shape))
        start += header.points * field.itemsize
    return table


def _ascii(data: bytes, header: _Header, path: Path) -> Table:
    names = [
        name if count == 0 else f"{name}_{count}"
        for name in header.dtype.names or ()
        for count in range(int(np.prod(header.dtype[name].shape)))
    ]
    if not data.strip():
        raise truncated_scan(path, header.points, header.dtype.itemsize, 0)
    return ascii_points(filled_rows(data), header.points, names, path)
