"""Tables of the thesis, reconstructed, as CSV files of this package."""

import csv
from importlib.resources import files


def table_rows(name: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file of this package, by the names of its columns."""
    text = (files("data.derived") / name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))
