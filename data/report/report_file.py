"""The file of a report."""

from pathlib import Path

from data.report.page import Page
from perception.atomic_file import write_atomically

REPORT = "report.html"


def write_page(page: Page, path: Path) -> Path:
    """Write a page whole or not at all; return the path.

    Raises:
        MissingDependencyError: Plotly is not installed.
        WriteError: The file cannot be written.
    """
    write_atomically(path, page.text().encode())
    return path


def write_run_report(folder: Path) -> Path:
    """Write `report.html` into the folder of a run; return its path.

    Raises:
        PerceptionError: The folder holds no results of a run, or a file is damaged.
    """
    from data.report.run_data import RunData
    from data.report.run_report import run_page

    return write_page(run_page(RunData.read(folder)), folder / REPORT)
