"""`trifuse check`: is this drive fit for use?"""

from functools import partial
from pathlib import Path

from tqdm import tqdm

from data.inspection import DriveReport, DriveSummary, Finding, inspect_drive
from data.open_drive import open_drive, sequences_in
from perception.errors import DriveError, PerceptionError


def check(root: Path, sequence: str | None = None, sensor: str | None = None) -> None:
    """Read a drive once; report what is missing, damaged or implausible.

    A part that is optional and not there is a note; what is damaged or implausible is a fault.

    Args:
        root: a KITTI raw drive, a folder of raw drives, tracking sequences, or object frames.
        sequence: only this one; else all.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.

    Raises:
        DriveError: there is a fault.
    """
    sequences = sequences_in(root) if sequence is None else [sequence]
    faults = 0
    for name in sequences:
        faults += _check_one(root, name, sensor, is_only=len(sequences) == 1)
    if faults:
        raise DriveError(
            root,
            expected="a drive without faults",
            found=f"{faults}",
            advice="see the table for the first of each kind",
        )


def _check_one(root: Path, sequence: str | None, sensor: str | None, *, is_only: bool) -> int:
    """Print the report of one drive and return its number of faults."""
    try:
        drive = open_drive(root, sequence=sequence, sensor=sensor)
    except PerceptionError as error:
        if is_only:
            raise
        print(f"{sequence}: cannot be opened\n  {error}\n")
        return 1
    progress_bar = partial(tqdm, desc=drive.name, unit="frame")
    report = inspect_drive(drive, progress=progress_bar)
    print(format_report(report))
    return report.faults


def format_report(report: DriveReport) -> str:
    """Return what a drive is and a table of what was found in it."""
    rows = [("", "what", "count", "first example"), *map(_row, report.findings)]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    table = [
        f"  {kind:<{widths[0]}}  {what:<{widths[1]}}  {count:>{widths[2]}}  {example}"
        for kind, what, count, example in rows
    ]
    lines = table if report.findings else []
    verdict = f"  {report.faults} faults" if report.faults else "  no faults"
    return "\n".join([_describe(report.summary), *lines, verdict, ""])


def _row(finding: Finding) -> tuple[str, str, str, str]:
    kind = "fault" if finding.is_fault else "note"
    return kind, finding.what, str(finding.count), finding.first_example


def _describe(summary: DriveSummary) -> str:
    words = [f"{summary.frames} frames"]
    if summary.seconds:
        words.append(f"{summary.seconds:.1f} s")
    if summary.distance_m is not None:
        words.append(f"{summary.distance_m:.1f} m driven")
    words.append(f"{summary.sensor} with {summary.mean_points:,.0f} points a scan")
    words.append(f"with {', '.join(summary.parts)}" if summary.parts else "scans only")
    return f"{summary.name}: {', '.join(words)}"
