"""Feather tables of a log, column by column, with one error for every reason for which they cannot be read."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data.kitti.reading import read_bytes
from perception.errors import PerceptionError, optional_package
from perception.types import Float64


@dataclass(frozen=True)
class FeatherTable:
    """Columns of one length.

    Attributes:
        path: File of the table.
        columns: (R,) values by the name of the column.
    """

    path: Path
    columns: Mapping[str, NDArray[Any]]

    def __len__(self) -> int:
        """Return R."""
        return len(next(iter(self.columns.values()), ()))

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return one column."""
        return self.columns[name]

    def numbers(self, *names: str) -> Float64:
        """Return (R, C) numbers of some columns."""
        columns = [np.asarray(self.columns[name], np.float64) for name in names]
        return np.stack(columns, axis=1)


def read_feather(
    path: Path,
    columns: Sequence[str],
    kind: type[PerceptionError],
    what: str,
    renamed: Mapping[str, str] | None = None,
) -> FeatherTable:
    """Read some columns of a table.

    Args:
        path: Feather file.
        columns: Names of the columns; a value may not be missing in any row.
        kind: Type of the error.
        what: Content that is expected, for the error.
        renamed: Other names that files use, by the name in `columns`.

    Raises:
        PerceptionError: The file is missing, damaged, or lacks a column or a value.
        MissingDependencyError: pyarrow is not installed.
    """
    table = _decode(path, read_bytes(path, kind, what), kind, what)
    found = {name: (renamed or {}).get(name, name) for name in columns}
    found = {name: other if other in table else name for name, other in found.items()}
    missing = [name for name, column in found.items() if column not in table]
    if missing:
        raise kind(
            path,
            expected=f"{what} with the columns {', '.join(columns)}",
            found=f"no {', '.join(missing)} among {', '.join(table) or 'none'}",
        )
    incomplete = [name for name, column in found.items() if table[column].null_count]
    if incomplete:
        raise kind(path, expected=f"a {incomplete[0]} in every row", found="rows without it")
    try:
        values = {name: _to_numpy(table[column]) for name, column in found.items()}
    except NotImplementedError as error:  # such as months
        raise kind(path, expected=f"{what} of numbers and texts", found=str(error)) from error
    return FeatherTable(path, values)


def _decode(path: Path, data: bytes, kind: type[PerceptionError], what: str) -> dict[str, Any]:
    with optional_package("pyarrow", needed_for=f"{path}", extra="tables"):
        from pyarrow import ArrowException, BufferReader, feather
    try:
        table = feather.read_table(BufferReader(data))
        table.validate(full=True)
    except (ArrowException, OSError, ValueError) as error:
        raise kind(
            path,
            expected=f"{what} as a feather table",
            found=f"{len(data)} bytes that cannot be read as one",
            advice="copy the file again, it may be cut off",
        ) from error
    return dict(zip(table.column_names, table.columns, strict=True))


def _to_numpy(column: Any) -> NDArray[Any]:  # noqa: ANN401 - pyarrow has no types
    """Return (R,) numbers or texts."""
    values = column.to_numpy()
    return np.asarray(values.astype(np.str_) if values.dtype == object else values)
