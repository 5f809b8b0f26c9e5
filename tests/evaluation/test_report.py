"""Tables from declared columns."""

from perception.evaluation.report import Column, Table

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
