"""`trifuse report`."""

from pathlib import Path


def report(results: Path, other: Path | None = None, *, html: Path | None = None) -> None:
    """Write the HTML report of results again, or compare two runs of a drive.

    One file that needs no network: summary, a player of the frames, tracks, errors, times, configuration, versions.

    Example: trifuse report results/before results/after --html compared.html

    Args:
        results: Folder of `trifuse run` or of a training, or the JSON report of an evaluation or benchmark.
        other: Folder of a second run, shown beside the first; leave it out for the report of one.
        html: HTML file; by default report.html in the folder, comparison.html in that of the second run, or the name of the
            JSON report with .html.
    """
    from data.report.page import require_plotly
    from data.report.report_file import write_report
    from perception.cli.progress import frame_progress_bar

    require_plotly()
    print(f"report: {write_report(results, other, html, frame_progress_bar('report'))}")
