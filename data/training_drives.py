"""Which drives a network learns from, and by which it is judged."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from data.array_store import ArrayStore
from data.open_drive import open_drive, sequences_in
from perception.errors import DriveError
from perception.types import Drive


@dataclass(frozen=True)
class TrainingDrives:
    """Which drives are learned from.

    Attributes:
        training: drives, or folders of drives or sequences, all of which are taken.
        validation: likewise, to judge by; none keeps a share of the training frames back.
        cache: folder for what is made of the frames; else the user's cache folder.
        cache_gb: what is unused for the longest time is deleted where there is more.
    """

    training: tuple[Path, ...]
    validation: tuple[Path, ...] = ()
    cache: Path | None = None
    cache_gb: float = 20.0

    @property
    def parts(self) -> list[tuple[Path, ...]]:
        """Those learned from, and those to judge by where there are some."""
        return [paths for paths in (self.training, self.validation) if paths]

    @property
    def store(self) -> ArrayStore:
        """Open where things made of the frames are kept."""
        return ArrayStore(self.cache, int(self.cache_gb * 1e9))


def open_drives(paths: Sequence[Path], *, images: bool = True) -> list[Drive]:
    """Open every drive of every path.

    Raises:
        DriveError: there is no path, or one is no drive.
    """
    if not paths:
        raise DriveError("training", expected="drives to learn from", found="none")
    return [
        open_drive(path, sequence=sequence, images=images)
        for path in paths
        for sequence in sequences_in(path)
    ]
