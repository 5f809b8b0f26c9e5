from perception.cli.table import format_table, percent


def test_columns_align_and_what_is_unknown_is_a_dash():
    text = format_table(
        "Title", ("", "mDE [m]", "objects"), [["0 to 5 m", 0.0281, 7], ["all", float("nan"), None]]
    )
    assert text.splitlines() == [
        "Title",
        "          mDE [m]  objects",
        "--------------------------",
        "0 to 5 m    0.028        7",
        "all             -        -",
    ]


def test_a_table_without_rows_keeps_its_header():
    assert format_table("None", ("", "a"), []).splitlines() == ["None", "  a", "---"]


def test_percent_of_nothing_is_unknown():
    assert percent(1, 8) == "12.5 %"
    assert percent(0, 0) is None
