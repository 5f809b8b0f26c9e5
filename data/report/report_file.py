"""The file of a report."""

from pathlib import Path

from data.report.page import Page, can_write_report
from data.results.folder import DRIVES
from data.results.run_folder import FRAMES
from perception.atomic_file import write_atomically
from perception.errors import DriveError
from perception.types import Progress

REPORT, COMPARISON = "report.html", "comparison.html"


def write_page(page: Page, path: Path) -> Path:
    """Write a page whole or not at all; return the path.

    Raises:
        MissingDependencyError: Plotly is not installed.
        WriteError: The file cannot be written.
    """
    write_atomically(path, page.text().encode())
    return path


def write_report(
    results: Path, other: Path | None = None, out: Path | None = None, progress: Progress = iter
) -> Path:
    """Write the report of results, or of two runs beside each other; return its path.

    Args:
        results: Folder of a run or a training, or the JSON report of an evaluation or a benchmark.
        other: Folder of the run that is compared; None for one report.
        out: HTML file; else report.html in the folder, comparison.html in that of the second run, or the name of the
            JSON file with .html.
        progress: Progress bar around the rows of a run's video.

    Raises:
        PerceptionError: There are no such results, or a file is damaged.
    """
    from data.report.run_data import RunData

    if other is not None:
        from data.report.comparison import comparison_page

        page = comparison_page(RunData.read(results), RunData.read(other))
        return write_page(page, out or other / COMPARISON)
    if (results / FRAMES).is_file():
        from data.report.run_report import run_page

        return write_page(run_page(RunData.read(results), progress), out or results / REPORT)
    if (results / DRIVES).is_file():
        from data.report.fleet_report import fleet_page

        return write_page(fleet_page(results), out or results / REPORT)
    if results.is_dir():
        from data.report.training_report import is_training, training_page

        if is_training(results):
            return write_page(training_page(results), out or results / REPORT)
        raise DriveError(
            results,
            expected="a folder that `trifuse run`, `trifuse batch` or `trifuse train` wrote",
            found="another",
        )
    from data.report.document_report import document_page, read_document

    return write_page(document_page(read_document(results)), out or page_beside(results))


def write_documents(
    document: object, json: Path | None, html: Path | None, *, has_page: bool
) -> Path | None:
    """Write a document as JSON and as a page; return the path of the page, None without one.

    Args:
        document: Document.
        json: JSON file, or None.
        html: HTML file; None for one beside the JSON file.
        has_page: Whether a page is written beside the JSON file, where plotly is installed.

    Raises:
        WriteError: A file cannot be written.
    """
    from data.report.document_report import document_page
    from data.results.documents import to_serializable, write_json

    page = html
    if json is not None:
        write_json(json, document)
        if page is None and has_page and can_write_report():
            page = page_beside(json)
    return None if page is None else write_page(document_page(to_serializable(document)), page)


def page_beside(document: Path) -> Path:
    """Return where the report of a JSON document lies by default."""
    page = document.with_suffix(".html")
    return page if page != document else document.with_name(f"{document.name}.html")
