"""Tables of a run as Parquet files, for pandas, DuckDB and Arrow."""

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from data.exports.table_rows import Rows, table_rows
from data.exports.table_schema import TABLES, TableColumn
from data.results.result_writer import ResultWriter
from perception.atomic_file import atomic_file, part_of, writing
from perception.errors import LabelError
from perception.render.scene import SelectedObject
from perception.snapshot import Restorable, read_snapshot, write_snapshot
from perception.types import Result

if TYPE_CHECKING:
    import pyarrow

# Frames whose rows wait in memory, some 20 MB; a row group holds them.
_GROUP_FRAMES = 500


class TableWriter(ResultWriter):
    """Writes `tables/*.parquet`; each file is whole at the end of the run, also of one that stops early."""

    def __init__(self, out: Path, min_vehicle_score: float) -> None:
        """Begin the tables, in files of batches of rows.

        Args:
            out: Folder of the results.
            min_vehicle_score: Score from which a vehicle is listed.
        """
        self._min_vehicle_score = min_vehicle_score
        self._tables = {name: ParquetTable(out / "tables" / f"{name}.parquet") for name in TABLES}

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Add the rows of one frame."""
        for name, rows in table_rows(result, self._min_vehicle_score).items():
            self._tables[name].add(rows)

    def snapshot(self) -> bytes:
        """Write the rows that wait; return the length of each file of batches."""
        return write_snapshot({name: table.snapshot() for name, table in self._tables.items()})

    def restore(self, snapshot: bytes) -> None:
        """Go on with the rows of the frames so far."""
        for name, of_table in read_snapshot(snapshot, "tables").items():
            self._tables[name].restore(of_table)

    def close(self, *, is_complete: bool) -> None:
        """Put the files in their places, with the frames that were added."""
        with ExitStack() as stack:  # each of them, also where one finds no room
            for table in self._tables.values():
                stack.callback(table.close, is_complete=is_complete)


class ParquetTable(Restorable):
    """One Parquet file: batches of rows in a stream of Arrow, which a killed process leaves, and the whole at the end.

    A Parquet file cannot be continued: what tells where its rows are is written last.
    """

    memories = ("_written",)

    def __init__(self, path: Path) -> None:
        """Write nothing yet; make the folder.

        Args:
            path: Path of the file; its stem is the name of the table in `TABLES`.

        Raises:
            WriteError: The folder cannot be made.
        """
        self._path, self._columns = path, TABLES[path.stem]
        self._batches = part_of(path).with_suffix(".arrows")
        self._schema = arrow_schema(path.stem)
        self._waiting: list[Rows] = []
        self._written, self._has_snapshot, self._is_closed = 0, False, False
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)

    def add(self, rows: Rows) -> None:
        """Add the rows of a frame; a batch, later a row group, is written when those of enough frames wait.

        Raises:
            WriteError: The file cannot be written.
        """
        if self._is_closed:
            return
        self._waiting.append(rows)
        if len(self._waiting) >= _GROUP_FRAMES:
            self._write_waiting()

    def snapshot(self) -> bytes:
        """Write the rows that wait; return the length of the file of batches."""
        self._write_waiting()
        self._has_snapshot = True
        return super().snapshot()

    def restore(self, snapshot: bytes) -> None:
        """Go on with the batches of an earlier process; one that was killed after its last frame has left the table.

        Raises:
            LabelError: The file of batches is shorter than it was, or gone without a table.
        """
        super().restore(snapshot)
        self._has_snapshot = True
        found = self._batches.stat().st_size if self._batches.is_file() else 0
        # Without its rows there is nothing to go on with; nothing more is written then.
        self._is_closed = found < self._written
        if self._is_closed and (found or not self._path.is_file()):
            raise LabelError(
                self._batches,
                expected=f"the {self._written} bytes that were written before the run was stopped",
                found=f"{found} bytes",
                advice="start again with --overwrite",
            )

    def close(self, *, is_complete: bool) -> None:
        """Write what waits, and the file; the batches stay where a run that was stopped may go on.

        Raises:
            WriteError: A file cannot be written.
        """
        import pyarrow
        from pyarrow.parquet import ParquetWriter

        if self._is_closed:
            return
        try:
            self._write_waiting()
            with (
                atomic_file(self._path) as part,
                ParquetWriter(part, self._schema, compression="zstd") as file,
            ):
                if self._written:
                    with self._batches.open("rb") as batches:
                        for batch in pyarrow.ipc.open_stream(batches):
                            file.write_batch(batch)
        finally:
            if is_complete or not self._has_snapshot:
                self._batches.unlink(missing_ok=True)

    def _write_waiting(self) -> None:
        import pyarrow

        if not self._waiting:
            return
        arrays = [
            _arrow_array(np.concatenate([rows[name] for rows in self._waiting]), column)
            for name, column in self._columns.items()
        ]
        batch = pyarrow.record_batch(arrays, schema=self._schema)
        data = batch.serialize().to_pybytes()
        if not self._written:
            data = self._schema.serialize().to_pybytes() + data
        with writing(self._path), self._batches.open("ab") as file:
            file.truncate(self._written)  # what a killed process has written since
            file.write(data)
        self._written += len(data)
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
