"""The drives that studies look at, and how far they are."""

from collections.abc import Iterable
from pathlib import Path

from data.open_drive import open_drive
from data.synthetic.drive import SyntheticDrive
from perception.cli.progress import progress_bar
from perception.types import Drive, Frame

_SYNTHETIC_FRAMES = 40


def study_drive(drive: str, sequence: str | None, *, images: bool = False) -> Drive:
    """Open a path, or make the drive that the word synthetic stands for."""
    if drive == "synthetic":
        return SyntheticDrive(_SYNTHETIC_FRAMES, images=images)
    return open_drive(Path(drive), sequence=sequence, images=images)


def scan_bar(frames: Iterable[Frame], total: int | None = None) -> Iterable[Frame]:
    """Show how far a study is through a drive, where it takes long."""
    return progress_bar(frames, "study", total, delay_s=2)
