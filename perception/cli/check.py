"""`trifuse check`."""

from pathlib import Path

from perception.cli.flags import SourceFlags
from perception.errors import DriveError


def check(root: Path, *, source: SourceFlags) -> None:
    """Read every frame of a drive; report what is missing, damaged or implausible.

    Optional parts that are missing are notes; damaged or implausible data are faults, and the exit code is 2.

    Example: trifuse check kitti/tracking --sequence 0000

    Args:
        root: Folder or file of a drive in any layout; of several, all are checked.

    Raises:
        DriveError: There is a fault.
    """
    from data.inspection import inspect_path
    from perception.cli.progress import frame_progress_bar

    faults = 0
    for text, count in inspect_path(
        root, source.sequence, source.reading, lambda name: frame_progress_bar(name, delay_s=0)
    ):
        print(text)
        faults += count
    if faults:
        raise DriveError(
            root,
            expected="a drive without faults",
            found=f"{faults}",
            advice="the table shows the first example of each kind",
        )
