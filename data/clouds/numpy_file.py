""".npy and .npz: one array of rows, a structured array, or an array for each column."""

import ast
import io
import struct
import zipfile
import zlib
from collections.abc import Sequence
from operator import index
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from data.clouds.cloud import Cloud, Table, cloud_of_columns, cloud_of_rows, column_of
from data.clouds.cloud import named_columns as _named
from data.clouds.file_bytes import read_scan_bytes, require_scan_size, truncated_scan
from perception.errors import ScanError

_XYZ = ("x", "y", "z")
# What reading a header as Python, and a type from it, may raise.
_MALFORMED = (
    ValueError, SyntaxError, LookupError, TypeError, ArithmeticError, MemoryError, RecursionError,
)  # fmt: skip


def read_npy(path: Path, columns: Sequence[str] | None = None) -> Cloud:
    """Read a .npy file: (N, C) rows, or N records with named fields.

    Args:
        path: File of one array.
        columns: Name of each column; else those of the file.

    Raises:
        ScanError: The file is damaged, or holds another array.
    """
    return _cloud(_array(read_scan_bytes(path), path), columns, path)


def read_npz(path: Path, columns: Sequence[str] | None = None) -> Cloud:
    """Read a .npz file: one array as in .npy, or arrays named as the columns; `points` or `xyz` holds several.

    Raises:
        ScanError: The file is damaged, larger than any scan once decompressed, or holds other arrays.
    """
    arrays = _arrays(read_scan_bytes(path), path)
    if len(arrays) == 1:
        return _cloud(next(iter(arrays.values())), columns, path)
    singles = {name: array for name, array in arrays.items() if array.ndim == 1}
    tables = [array for array in arrays.values() if array.ndim == 2 and array.shape[1] >= 3]
    if {column_of(name) for name in singles} >= set(_XYZ):
        length = max(map(len, singles.values()))
        return cloud_of_columns({n: a for n, a in singles.items() if len(a) == length}, path)
    if len(tables) != 1:
        raise ScanError(
            path,
            expected="one array of rows, or arrays named x, y, z, intensity, ring, t",
            found=", ".join(f"{name} {array.shape}" for name, array in arrays.items()) or "none",
        )
    rows = tables[0]
    names = columns or (*_XYZ, "intensity", "ring", "t")[: rows.shape[1]]
    table = _named([rows[:, k] for k in range(rows.shape[1])], names, path)
    return cloud_of_columns(
        {**table, **{n: a for n, a in singles.items() if len(a) == len(rows)}}, path
    )


def _cloud(array: NDArray[Any], columns: Sequence[str] | None, path: Path) -> Cloud:
    if array.dtype.names is not None:
        table: Table = {name: array[name].ravel() for name in array.dtype.names}
        return cloud_of_columns(
            _named(list(table.values()), columns, path) if columns else table, path
        )
    if array.ndim == 3:  # an organised cloud
        height, width, numbers = array.shape
        array = array.reshape(height * width, numbers)
    if array.ndim != 2 or array.dtype.kind not in "fiu":
        raise ScanError(
            path,
            expected="an (N, C) array of numbers",
            found=f"{array.dtype} of shape {array.shape}",
        )
    return cloud_of_rows(array, columns, path)


def _arrays(data: bytes, path: Path) -> dict[str, NDArray[Any]]:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = [one for one in archive.infolist() if one.filename.endswith(".npy")]
            # An entry is never decompressed beyond the size that it states.
            require_scan_size(sum(entry.file_size for entry in entries), path)
            return {
                one.filename.removesuffix(".npy"): _array(archive.read(one), path)
                for one in entries
            }
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, ValueError) as error:
        raise ScanError(path, expected="a .npz archive of arrays", found=str(error)) from error


def _array(data: bytes, path: Path) -> NDArray[Any]:
    """Return the array in the bytes of a .npy file; objects, which could run code, are refused."""
    try:
        file = io.BytesIO(data)
        version = np.lib.format.read_magic(file)
        (size,) = struct.unpack(
            "<H" if version[0] == 1 else "<I", file.read(2 if version[0] == 1 else 4)
        )
        header = ast.literal_eval(file.read(size).decode("utf-8" if version[0] == 3 else "latin1"))
        dtype = np.lib.format.descr_to_dtype(header["descr"])
        shape = tuple(map(index, header["shape"]))
        order: Literal["F", "C"] = "F" if header["fortran_order"] else "C"
        count = int(np.prod(shape, dtype=object))
    except (*_MALFORMED, struct.error) as error:
        raise ScanError(
            path, expected="an array of NumPy", found=str(error) or "no header"
        ) from error
    if dtype.hasobject or dtype.itemsize == 0 or dtype.subdtype is not None:
        found = "Python objects, which are not read" if dtype.hasobject else f"the type {dtype}"
        raise ScanError(path, expected="an array of numbers", found=found)
    if min(shape, default=0) < 0 or count * dtype.itemsize > len(data) - file.tell():
        raise truncated_scan(path, count, dtype.itemsize, len(data) - file.tell())
    flat = np.frombuffer(data, dtype, count=count, offset=file.tell())
    try:
        return flat.reshape(shape, order=order)
    except ValueError as error:  # an axis beyond any memory beside one of no length
        raise ScanError(
            path, expected="an array of numbers", found=f"one of shape {shape}"
        ) from error
