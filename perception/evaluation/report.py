"""What a measure reports: columns declared once, from which the table, the JSON document and the plot come."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from perception.types import Labels, PointTruth, Result

Row = TypeVar("Row")
Whole = TypeVar("Whole")
Report_co = TypeVar("Report_co", bound="Report", covariant=True)
Value = str | int | float | None


@dataclass(frozen=True)
class Column(Generic[Row]):
    """One column of a report.

    Attributes:
        name: Heading with unit, such as `mDE [m]`.
        value: Returns the value of a row; None or NaN where it is unknown.
        spec: Format specification of the value in the table, such as `.4f`.
        key: Name in the JSON document; None keeps the column out of it.
    """

    name: str
    value: Callable[[Row], Value]
    spec: str = ""
    key: str | None = None

    def of(self, part: Callable[[Whole], Row]) -> "Column[Whole]":
        """Return the column of a row that holds this column's row as a part."""
        return Column(self.name, lambda row: self.value(part(row)), self.spec, self.key)

    def cell(self, row: Row) -> str:
        """Return the value as text, a dash where it is unknown."""
        value = self.value(row)
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return "-"
        return format(value, self.spec)


@dataclass(frozen=True)
class Table(Generic[Row]):
    """Rows of one kind under a title.

    Attributes:
        title: Line above the table.
        heading: Heading of the first column, which holds the names of the rows.
        columns: All other columns.
        rows: Rows by name, in the order in which they are printed.
        notes: Lines below the table.
    """

    title: str
    columns: Sequence[Column[Row]]
    rows: Mapping[str, Row]
    heading: str = ""
    notes: Sequence[str] = ()

    def text(self) -> str:
        """Return the table as text, the first column to the left, all others to the right."""
        header = [self.heading, *(column.name for column in self.columns)]
        cells = [[name, *(c.cell(row) for c in self.columns)] for name, row in self.rows.items()]
        return "\n".join([format_table(self.title, header, cells), *self.notes])

    def to_json(self) -> dict[str, dict[str, Value]]:
        """Return the values of the columns that have a key, by row."""
        return {
            name: {c.key: c.value(row) for c in self.columns if c.key is not None}
            for name, row in self.rows.items()
        }


class Report(Protocol):
    """Metrics of one evaluation."""

    def tables(self) -> Sequence[Table[Any]]:
        """Return what is printed."""
        ...

    def to_json(self) -> dict[str, Any]:
        """Return what `--json` writes below `results`."""
        ...


class Measure(Protocol[Report_co]):
    """Accumulates metrics frame by frame, as the metrics of torchmetrics do."""

    def update(self, result: Result, labels: Labels | None, truth: PointTruth | None) -> None:
        """Add one frame.

        Args:
            result: Output of the pipeline.
            labels: Labelled objects of the frame, or None.
            truth: Exact truth of each point, or None.
        """
        ...

    def compute(self) -> Report_co:
        """Return the metrics of all frames so far."""
        ...


def format_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a title, a header and rows as text: the first column to the left, all others to the right."""
    cells = [list(header), *map(list, rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [_line(row, widths) for row in cells]
    rule = "-" * max(map(len, lines))
    return "\n".join([title, lines[0], rule, *lines[1:]])


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = (
        cell.rjust(width) if column else cell.ljust(width)
        for column, (cell, width) in enumerate(zip(row, widths, strict=True))
    )
    return "  ".join([first, *others]).rstrip()
