"""`trifuse check`."""

from pathlib import Path

from perception.cli.flags import SourceFlags
from perception.errors import DriveError, PerceptionError


def check(root: Path, *, source: SourceFlags) -> None:
    """Read every frame of a drive; report what is missing, damaged or implausible.

    Optional parts that are missing are notes; damaged or implausible data are faults, and the exit code is 2.

    Example: trifuse check kitti/tracking --sequence 0000

    Args:
        root: Folder or file of a drive in any layout; of several, all are checked.

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
            drive = open_drive(root, sequence=name, config=source.reading)
        except PerceptionError as error:
            if len(sequences) == 1:
                raise
            print(f"{name}: cannot be opened\n  {error}\n")
            faults += 1
            continue
        report = inspect_drive(drive, progress=frame_progress_bar(drive.name, delay_s=0))
        print(report.text())
        faults += report.faults
    if faults:
        raise DriveError(
            root,
            expected="a drive without faults",
            found=f"{faults}",
            advice="the table shows the first example of each kind",
        )
