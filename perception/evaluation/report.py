"""What a measure reports: metrics that are declared once, where table, JSON document and plot take them from."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial, reduce
from operator import add, methodcaller
from typing import Any, Final, Generic, Protocol, Self, TypeVar, get_type_hints

from perception.types import Labels, PointTruth, Result

Row = TypeVar("Row")
Summed = TypeVar("Summed", bound="SummedMetrics")
Report_co = TypeVar("Report_co", bound="Report", covariant=True)
Value = str | int | float | None

# Annotation of a field that the tables need and the JSON document states elsewhere, such as a protocol.
CONTEXT: Final = "context"
# Name of the row that holds all sequences of a set together.
TOTAL = "Total"


@dataclass(frozen=True)
class Metric:
    """Declaration of how a metric is printed: `mde_m: Annotated[float, Metric("mDE [m]", ".4f")]`.

    Attributes:
        heading: Heading with unit.
        spec: Format specification, such as `.4f`; `.1%` prints a share as 12.3 below a heading in percent.
    """

    heading: str
    spec: str = ""


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

    def cell(self, row: Row) -> str:
        """Return the value as text, a dash where it is unknown."""
        value = self.value(row)
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return "-"
        return format(value, self.spec).removesuffix("%")


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

    @property
    def header(self) -> list[str]:
        """Headings of all columns."""
        return [self.heading, *(column.name for column in self.columns)]

    @property
    def cells(self) -> list[list[str]]:
        """Cells of each row as text."""
        return [[name, *(c.cell(row) for c in self.columns)] for name, row in self.rows.items()]

    def text(self) -> str:
        """Return the table as text, the first column to the left, all others to the right."""
        return "\n".join([format_table(self.title, self.header, self.cells), *self.notes])

    def printed(self) -> dict[str, object]:
        """Return the table as it is printed, for a document."""
        return {
            "title": self.title,
            "header": self.header,
            "rows": self.cells,
            "notes": list(self.notes),
        }

    def to_json(self) -> dict[str, dict[str, Value]]:
        """Return the values of the columns that have a key, by row."""
        return {
            name: {c.key: c.value(row) for c in self.columns if c.key is not None}
            for name, row in self.rows.items()
        }


class Metrics:
    """Base of metrics: a frozen dataclass that is one row of a table, and one section of the JSON document.

    Fields and properties that are annotated with a `Metric` are columns; in the document, these properties and
    all fields but `CONTEXT` have their own names.
    """

    @classmethod
    def columns(cls) -> list[Column[Self]]:
        """Return a column for each declared metric, fields first."""
        return [
            Column(metric.heading, partial(_attribute, name), metric.spec, name)
            for name, annotations in _annotations(cls)
            for metric in annotations
            if isinstance(metric, Metric)
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the fields and the declared properties by name."""
        return {
            name: _document(getattr(self, name))
            for name, annotations in _annotations(type(self))
            if CONTEXT not in annotations
        }


class SummedMetrics(Metrics):
    """Base of counts and sums: those of several frames or sequences are added, field by field."""

    def __add__(self, other: Self) -> Self:
        """Return the sums of both."""
        names = (field.name for field in fields(self))  # type: ignore[arg-type]
        return type(self)(*(getattr(self, name) + getattr(other, name) for name in names))


def with_total(rows: Mapping[str, Summed]) -> dict[str, Summed]:
    """Return rows, such as those of several sequences, and behind them their sum."""
    return {**rows, TOTAL: reduce(add, rows.values())} if rows else {}


class Report(Metrics):
    """Metrics of one evaluation: what is printed, and what `--json` writes below `results`."""

    def tables(self) -> Sequence[Table[Any]]:
        """Return what is printed."""
        raise NotImplementedError

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by name, without those that the data do not allow."""
        parts = super().to_json().items()
        return {n: part for n, part in parts if part is not None and not _is_empty(part)}


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


def value_table(
    title: str, rows: Mapping[str, Mapping[str, Value]], spec: str = "", heading: str = ""
) -> Table[Mapping[str, Value]]:
    """Return a table of values of one format by row, then by column; a column that a row lacks has a dash."""
    names = dict.fromkeys(name for row in rows.values() for name in row)
    columns = [Column[Any](name, methodcaller("get", name), spec, name) for name in names]
    return Table(title, columns, rows, heading)


def _attribute(name: str, row: object) -> Any:  # noqa: ANN401 - any metric
    return getattr(row, name, None)


def _annotations(kind: type) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Yield the fields of a dataclass and its properties that are metrics, with what annotates them."""
    hints = get_type_hints(kind, include_extras=True)
    for field in fields(kind):
        yield field.name, getattr(hints[field.name], "__metadata__", ())
    for name, member in vars(kind).items():
        if isinstance(member, property):
            hint = get_type_hints(member.fget, include_extras=True).get("return")
            if annotations := getattr(hint, "__metadata__", ()):
                yield name, annotations


def _is_empty(part: object) -> bool:
    return isinstance(part, Mapping) and not part


def _document(part: Any) -> Any:  # noqa: ANN401 - any value of a report
    if isinstance(part, Metrics):
        return part.to_json()
    if isinstance(part, Mapping):
        return {name: _document(value) for name, value in part.items()}
    return part
