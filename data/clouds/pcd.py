""".pcd of the Point Cloud Library: ascii, binary, and binary compressed by LZF."""

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from data.clouds.cloud import Cloud, Table, cloud_of_columns, named_columns, unique_names
from data.clouds.file_bytes import (
    ascii_points,
    filled_rows,
    read_scan_bytes,
    require_scan_size,
    truncated_scan,
)
from perception.errors import ScanError
from perception.geometry.se3 import from_rotation_translation
from perception.types import Float64

_MAX_HEADER_BYTES = 1 << 14
_KINDS = {"F": "f", "I": "i", "U": "u"}
_FORMS = ("ascii", "binary", "binary_compressed")


@dataclass(frozen=True)
class _Header:
    """Metadata of a file, the text at its start.

    Attributes:
        dtype: Type of one point, with a field for each column that has numbers.
        points: Number of points.
        form: Form of the data: ascii, binary or binary_compressed.
        viewpoint: (4, 4) pose of the sensor, or None for the identity.
        end: Number of bytes of the header.
    """

    dtype: np.dtype[Any]
    points: int
    form: str
    viewpoint: Float64 | None
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
    if columns:
        table = named_columns(list(table.values()), columns, path)
    cloud = cloud_of_columns(table, path)
    return cloud if header.viewpoint is None else replace(cloud, viewpoint=header.viewpoint)


def read_viewpoint(path: Path) -> Float64 | None:
    """Read the pose of the sensor off the header of a file.

    Returns:
        (4, 4) pose; None for the identity, for another format, and where there is no such header.
    """
    if path.suffix.lower() != ".pcd":
        return None
    try:
        with path.open("rb") as file:
            return _parse_header(file.read(_MAX_HEADER_BYTES), path).viewpoint
    except (OSError, ScanError):
        return None  # said where the scan is read


def _parse_header(data: bytes, path: Path) -> _Header:
    rows: dict[str, list[str]] = {}
    file = io.BytesIO(data[:_MAX_HEADER_BYTES])
    while "DATA" not in rows and (line := file.readline()):
        words = line.decode("latin1").split("#")[0].split()
        if words:
            rows[words[0].upper()] = words[1:]
    rows.setdefault("FIELDS", rows.get("COLUMNS", []))  # its name until version 0.5
    if missing := [key for key in ("FIELDS", "DATA") if not rows.get(key)]:
        raise ScanError(
            path, expected="the header of a PCD file", found=f"none of {', '.join(missing)}"
        )
    try:
        dtype, form = _point_type(rows), rows["DATA"][0].lower()
        # Old files state POINTS alone, and some unorganised ones a HEIGHT of 0.
        size = [int(rows[key][0]) for key in ("WIDTH", "HEIGHT") if key in rows]
        stated = int(rows["POINTS"][0]) if "POINTS" in rows else None
        points = math.prod(size) if len(size) == 2 and (all(size) or not stated) else stated
        if points is None:
            raise ValueError("neither WIDTH and HEIGHT nor POINTS")
        viewpoint = _viewpoint(rows.get("VIEWPOINT"))
    except (ValueError, IndexError, KeyError, TypeError) as error:
        raise ScanError(
            path,
            expected="a PCD header with a SIZE, a TYPE and a COUNT for each of its FIELDS",
            found=f"one that does not fit together ({error})",
        ) from error
    if stated not in (None, points) or points < 0 or form not in _FORMS:
        raise ScanError(
            path,
            expected=f"WIDTH times HEIGHT points, and DATA of {', '.join(_FORMS)}",
            found=f"POINTS {stated}, WIDTH times HEIGHT {points}, DATA {form}",
        )
    return _Header(dtype, points, form, viewpoint, file.tell())


def _point_type(rows: Mapping[str, list[str]]) -> np.dtype[Any]:
    names = unique_names(rows["FIELDS"])
    usual = {"TYPE": "F", "SIZE": "4", "COUNT": "1"}
    stated = (rows.get(key, [value] * len(names)) for key, value in usual.items())
    fields: list[Any] = []
    for name, kind, size, count in zip(names, *stated, strict=True):
        one = np.dtype(f"<{_KINDS[kind.upper()]}{int(size)}")
        if int(count) < 0:
            raise ValueError(f"COUNT {count}")
        if int(count) > 0:  # a field that is not used may hold no number
            fields.append((name, one) if int(count) == 1 else (name, one, (int(count),)))
    return np.dtype(fields)


def _viewpoint(words: Sequence[str] | None) -> Float64 | None:
    """Return the (4, 4) pose of x y z qw qx qy qz; None for the identity."""
    if words is None:
        return None
    numbers = tuple(map(float, words))
    if len(numbers) != 7 or not all(map(math.isfinite, numbers)):
        raise ValueError(f"VIEWPOINT {' '.join(words)}")
    xyz_m, w, vector = numbers[:3], numbers[3], numbers[4:]
    if not any(vector):
        w = 1.0  # some programs write zeros for no rotation
    if not any(vector + xyz_m):
        return None
    rotation = Rotation.from_quat([*vector, w]).as_matrix()
    return from_rotation_translation(rotation, np.array(xyz_m))


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
    stored = data[8 : 8 + packed]
    try:
        # Columns that would not get shorter are stored as they are.
        unpacked = stored if packed == size else lzf.decompress(stored, size)
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
    rows = filled_rows(data)
    if not rows:
        raise truncated_scan(path, header.points, header.dtype.itemsize, 0)
    return ascii_points(rows, header.points, names, path)
