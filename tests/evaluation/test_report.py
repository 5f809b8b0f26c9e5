"""Tables from declared columns."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from perception.evaluation.report import (
    CONTEXT,
    Column,
    Metric,
    Metrics,
    Report,
    SummedMetrics,
    Table,
    value_table,
)

COLUMNS = (
    Column("mDE [m]", lambda row: row[0], ".3f", "mde_m"),
    Column("objects", lambda row: row[1]),
)


def test_columns_align_and_unknown_values_are_dashes():
    table = Table("Title", COLUMNS, {"0 to 5 m": (0.0281, 7), "all": (float("nan"), None)})
    assert table.text().splitlines() == [
        "Title",
        "          mDE [m]  objects",
        "--------------------------",
        "0 to 5 m    0.028        7",
        "all             -        -",
    ]


def test_a_table_without_rows_keeps_its_header():
    assert Table("None", COLUMNS[1:], {}).text().splitlines()[1:] == ["  objects", "---------"]


def test_the_document_has_the_columns_with_a_key():
    assert Table("", COLUMNS, {"all": (0.5, 7)}).to_json() == {"all": {"mde_m": 0.5}}


@dataclass(frozen=True)
class Share(Metrics):
    found: Annotated[float, Metric("found [%]", ".1%")]
    threshold: float

    @property
    def missed(self) -> Annotated[float, Metric("missed")]:
        return 1 - self.found


@dataclass(frozen=True)
class Shares(Report):
    title: Annotated[str, CONTEXT]
    rows: Mapping[str, Share]
    absent: Share | None = None


def test_declared_metrics_are_columns_and_a_share_is_printed_in_percent():
    columns = Share.columns()
    assert [column.name for column in columns] == ["found [%]", "missed"]
    assert [column.cell(Share(0.75, 0.5)) for column in columns] == ["75.0", "0.25"]


def test_a_document_has_fields_and_declared_properties_but_no_context_and_no_unknown_value():
    report = Shares("Title", {"all": Share(0.75, 0.5)})
    assert report.to_json() == {"rows": {"all": {"found": 0.75, "threshold": 0.5, "missed": 0.25}}}


def test_columns_of_values_are_those_of_any_row():
    table = value_table("", {"easy": {"color": 0.5}, "hard": {"color": 0.25, "depth": 1.0}}, ".0%")
    assert table.text().splitlines()[1:] == [
        "      color  depth",
        "------------------",
        "easy     50      -",
        "hard     25    100",
    ]


@dataclass(frozen=True)
class Counts(SummedMetrics):
    found: int = 0
    shares: float = 0.0


def test_counts_of_several_frames_are_added_by_field():
    assert sum([Counts(1, 0.5), Counts(2, 0.25)], Counts()) == Counts(3, 0.75)
