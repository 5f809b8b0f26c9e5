"""`trifuse check`."""

from pathlib import Path
from typing import TYPE_CHECKING

from perception.cli.flags import SourceFlags

if TYPE_CHECKING:
    from data.inspection import DriveReport, DriveSummary


def check(root: Path, *, source: SourceFlags) -> None:
    """Read every frame of a drive; report what is missing, damaged or implausible.

    Optional parts that are missing are notes; damaged or implausible data are faults, and the exit code is 2.

    Example: trifuse check kitti/tracking --sequence 0000

    Args:
        root: KITTI raw drive, folder of raw drives, tracking folder, object folder, or synthetic drive.

    Raises:
        DriveError: there is a fault.
    """
    from data.open_drive import sequences_in
    from perception.errors import DriveError

    sequences = sequences_in(root) if source.sequence is None else [source.sequence]
    is_only = len(sequences) == 1
    faults = sum(_check_one(root, name, source.sensor, is_only=is_only) for name in sequences)
    if faults:
        raise DriveError(
            root,
            expected="a drive without faults",
            found=f"{faults}",
            advice="the table shows the first example of each kind",
        )


def _check_one(root: Path, sequence: str | None, sensor: str | None, *, is_only: bool) -> int:
    """Print the report of one drive and return its number of faults."""
    from data.inspection import inspect_drive
    from data.open_drive import open_drive
    from perception.cli.progress import progress_bar
    from perception.errors import PerceptionError

    try:
        drive = open_drive(root, sequence=sequence, sensor=sensor)
    except PerceptionError as error:
        if is_only:
            raise
        print(f"{sequence}: cannot be opened\n  {error}\n")
        return 1
    report = inspect_drive(drive, progress=lambda frames: progress_bar(frames, drive.name))
    print(format_report(report))
    return report.faults


def format_report(report: "DriveReport") -> str:
    """Return a description of the drive and a table of the findings."""
    rows = [("", "finding", "count", "first example")]
    rows += [
        ("fault" if one.is_fault else "note", one.what, str(one.count), one.first_example)
        for one in report.findings
    ]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    table = [
        f"  {kind:<{widths[0]}}  {finding:<{widths[1]}}  {count:>{widths[2]}}  {example}"
        for kind, finding, count, example in rows
    ]
    verdict = f"  {report.faults} faults" if report.faults else "  no faults"
    return "\n".join([_describe(report.summary), *(table if report.findings else []), verdict, ""])


def _describe(summary: "DriveSummary") -> str:
    words = [f"{summary.frames} frames"]
    if summary.seconds:
        words.append(f"{summary.seconds:.1f} s")
    if summary.distance_m is not None:
        words.append(f"{summary.distance_m:.1f} m driven")
    words.append(f"{summary.sensor} with {summary.mean_points:,.0f} points/scan")
    words.append(f"with {', '.join(summary.parts)}" if summary.parts else "scans only")
    return f"{summary.name}: {', '.join(words)}"
