"""Tables of a run as Parquet files, for pandas, DuckDB and Arrow."""

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from data.exports.table_rows import Rows, table_rows
from data.exports.table_schema import TABLES, TableColumn
from data.results.result_writer import ResultWriter
from perception.atomic_file import atomic_file, writing
from perception.render.scene import SelectedObject
from perception.types import Result

if TYPE_CHECKING:
    import pyarrow

# Frames whose rows wait in memory, some 20 MB; a row group holds them.
_GROUP_FRAMES = 500


class TableWriter(ResultWriter):
    """Writes `tables/*.parquet`; each file is whole at the end of the run, also of one that stops early."""

    def __init__(self, out: Path, min_vehicle_score: float) -> None:
        """Begin the tables, in partial files.

        Args:
            out: Folder of the results.
            min_vehicle_score: Score from which a vehicle is listed.
        """
        self._min_vehicle_score = min_vehicle_score
        with ExitStack() as opened:
            self._tables = {
                name: opened.enter_context(ParquetTable(out / "tables" / f"{name}.parquet", name))
                for name in TABLES
            }
            self._files = opened.pop_all()

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Add the rows of one frame."""
        for name, rows in table_rows(result, self._min_vehicle_score).items():
            self._tables[name].add(rows)

    def close(self, *, is_complete: bool) -> None:
        """Put the files in their places, with the frames that were added."""
        self._files.close()


class ParquetTable:
    """One Parquet file, written by row groups; a context manager, at whose end it is whole."""

    def __init__(self, path: Path, name: str) -> None:
        """Prepare the schema.

        Args:
            path: Path of the file.
            name: Name of the table in `TABLES`.
        """
        self._path, self._columns = path, TABLES[name]
        self._schema = arrow_schema(name)
        self._waiting: list[Rows] = []

    def __enter__(self) -> Self:
        """Open the partial file."""
        from pyarrow.parquet import ParquetWriter

        with ExitStack() as opened:
            part = opened.enter_context(atomic_file(self._path))
            self._writer = opened.enter_context(
                ParquetWriter(part, self._schema, compression="zstd")
            )
            self._file = opened.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        """Write what waits, and put the file in its place."""
        with self._file:
            self._write_waiting()

    def add(self, rows: Rows) -> None:
        """Add the rows of a frame; a row group is written when those of enough frames wait.

        Raises:
            WriteError: The file cannot be written.
        """
        self._waiting.append(rows)
        if len(self._waiting) >= _GROUP_FRAMES:
            self._write_waiting()

    def _write_waiting(self) -> None:
        import pyarrow

        if not self._waiting:
            return
        arrays = [
            _arrow_array(np.concatenate([rows[name] for rows in self._waiting]), column)
            for name, column in self._columns.items()
        ]
        with writing(self._path):
            self._writer.write_table(pyarrow.Table.from_arrays(arrays, schema=self._schema))
        self._waiting = []


def arrow_schema(name: str) -> "pyarrow.Schema":
    """Return the Arrow schema of a table, with the description of each column in its metadata."""
    import pyarrow

    return pyarrow.schema(
        pyarrow.field(column, pyarrow.type_for_alias(one.type)).with_metadata(
            {"description": one.description}
        )
        for column, one in TABLES[name].items()
    )


def _arrow_array(values: NDArray[np.generic], column: TableColumn) -> "pyarrow.Array":
    """Return values as Arrow has them: null in the place of NaN and of empty text."""
    import pyarrow

    is_null = values == "" if column.type == "string" else values != values  # noqa: PLR0124 - NaN
    if column.type not in ("double", "string"):
        values = np.where(is_null, 0, values).astype(column.type)
    return pyarrow.array(values, pyarrow.type_for_alias(column.type), mask=is_null)
