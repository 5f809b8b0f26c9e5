"""`trifuse check`."""

from pathlib import Path
from typing import TYPE_CHECKING

from perception.cli.flags import SourceFlags
from perception.errors import DriveError, PerceptionError

if TYPE_CHECKING:
    from data.inspection import DriveReport


def check(root: Path, *, source: SourceFlags) -> None:
    """Read every frame of a drive; report what is missing, damaged or implausible.

    Optional parts that are missing are notes; damaged or implausible data are faults, and the exit code is 2.

    Example: trifuse check kitti/tracking --sequence 0000

    Args:
        root: KITTI raw drive, folder of raw drives, tracking folder, object folder, or synthetic drive.

    Raises:
        DriveError: There is a fault.
    """
    from data.inspection import inspect_drive
    from data.open_drive import open_drive, sequences_in
    from perception.cli.progress import frame_progress_bar

    sequences = sequences_in(root) if source.sequence is None else [source.sequence]
    faults = 0
    for name in sequences:
        try:
            drive = open_drive(root, sequence=name, sensor=source.sensor)
        except PerceptionError as error:
            if len(sequences) == 1:
                raise
            print(f"{name}: cannot be opened\n  {error}\n")
            faults += 1
            continue
        report = inspect_drive(drive, progress=frame_progress_bar(drive.name, delay_s=0))
        print(format_report(report))
        faults += report.faults
    if faults:
        raise DriveError(
            root,
            expected="a drive without faults",
            found=f"{faults}",
            advice="the table shows the first example of each kind",
        )


def format_report(report: "DriveReport") -> str:
    """Return a description of the drive and a table of the findings."""
    drive = report.summary
    words = [f"{drive.frames} frames"]
    if drive.seconds:
        words.append(f"{drive.seconds:.1f} s")
    if drive.distance_m is not None:
        words.append(f"{drive.distance_m:.1f} m driven")
    words.append(f"{drive.sensor} with {drive.mean_points:,.0f} points/scan")
    words.append(f"with {', '.join(drive.parts)}" if drive.parts else "scans only")
    rows = [("", "finding", "count", "first example")] if report.findings else []
    rows += [
        ("fault" if one.is_fault else "note", one.what, str(one.count), one.first_example)
        for one in report.findings
    ]
    widths = [max((len(row[column]) for row in rows), default=0) for column in range(3)]
    table = [
        f"  {kind:{widths[0]}}  {what:{widths[1]}}  {count:>{widths[2]}}  {example}"
        for kind, what, count, example in rows
    ]
    verdict = f"  {report.faults or 'no'} {'fault' if report.faults == 1 else 'faults'}"
    return "\n".join([f"{drive.name}: {', '.join(words)}", *table, verdict, ""])
