""".ply, ascii or binary of either byte order: the vertices of a file are its points."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from data.clouds.cloud import Cloud, Table, cloud_of_columns, named_columns, unique_names
from data.clouds.file_bytes import (
    ascii_points,
    filled_rows,
    read_scan_bytes,
    require_scan_size,
    truncated_scan,
)
from perception.errors import ScanError

_MAX_HEADER_BYTES = 1 << 16
_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class _Element:
    """An element of the file: its name, its number, and name and type of each property."""

    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list)

    def dtype(self, order: str) -> np.dtype[Any]:
        """Return the type of one of them."""
        names = unique_names([name for name, _ in self.properties])
        types = [f"{order}{kind}" for _, kind in self.properties]
        return np.dtype(list(zip(names, types, strict=True)))


def read_ply(path: Path, columns: Sequence[str] | None = None) -> Cloud:
    """Read the vertices of a .ply file.

    Args:
        path: File whose first element are the vertices.
        columns: Name of each property in place of the file's.

    Raises:
        ScanError: The header or the data are malformed, or there is less data than the header states.
    """
    data = read_scan_bytes(path)
    file = io.BytesIO(data)
    order, vertices = _parse_header(file, path)
    dtype = vertices.dtype(order)
    require_scan_size(vertices.count * dtype.itemsize, path)
    if order:
        found = len(data) - file.tell()
        if found < vertices.count * dtype.itemsize:
            raise truncated_scan(path, vertices.count, dtype.itemsize, found)
        points = np.frombuffer(data, dtype, vertices.count, file.tell())
        table: Table = {name: points[name] for name in dtype.names or ()}
    else:
        rows = filled_rows(file.read())[: vertices.count]  # faces and other elements follow
        table = ascii_points(rows, vertices.count, dtype.names or (), path)
    return cloud_of_columns(
        named_columns(list(table.values()), columns, path) if columns else table, path
    )


def _parse_header(file: io.BytesIO, path: Path) -> tuple[str, _Element]:
    """Return the byte order, empty of text, and the vertices."""
    lines: list[list[str]] = []
    while not lines or lines[-1][:1] != ["end_header"]:
        raw = file.readline(_MAX_HEADER_BYTES)
        if not raw or file.tell() > _MAX_HEADER_BYTES:
            raise ScanError(path, expected="the header of a PLY file", found="none that ends")
        lines.append(raw.decode("latin1").split())
    try:
        return _order_and_vertices(lines)
    except (ValueError, KeyError, IndexError) as error:
        raise ScanError(
            path,
            expected="a PLY header whose first element are vertices with one number a property",
            found=str(error),
        ) from error


def _order_and_vertices(lines: list[list[str]]) -> tuple[str, _Element]:
    if lines[0] != ["ply"]:
        raise ValueError("another format")
    order, elements = None, []
    for words in lines[1:]:
        if words[:1] == ["format"]:
            order = _ORDERS[words[1]]
        elif words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2])))
        elif words[:1] == ["property"] and words[1] == "list" and len(elements) == 1:
            raise ValueError("a list as a property of the vertices")
        elif words[:1] == ["property"] and words[1] != "list":
            elements[-1].properties.append((words[2], _TYPES[words[1]]))
    if order is None or not elements or elements[0].name != "vertex" or elements[0].count < 0:
        raise ValueError(f"elements {', '.join(one.name for one in elements) or 'none'}")
    if not elements[0].properties:  # any number of them would fit into the file
        raise ValueError("vertices without a property")
    return order, elements[0]
