"""Drives to which a network is adapted, and where the labels lie that it learns."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from data.label_proposals.proposals import FILE_NAME
from data.open_drive import open_drive, sequences_in
from data.recorded_drive import RecordedDrive
from export.adaptation_config import LearnedLabels
from perception.errors import UsageError

_SYNTHETIC_NAME = "training"  # of the drives that are learned beside


@dataclass(frozen=True)
class AdaptedDrive:
    """A drive to which a network is adapted.

    Attributes:
        path: Path of the drive.
        sequence: Sequence of the path, or None.
        drive: Drive, with images where they are learned.
        proposals: Folder of `trifuse label` that is learned; None for the labels of the drive.
    """

    path: Path
    sequence: str | None
    drive: RecordedDrive
    proposals: Path | None

    @property
    def is_labelled(self) -> bool:
        """Whether there is what is learned."""
        return self.proposals is None or (self.proposals / FILE_NAME).exists()

    def propose(self, label: Callable[[list[str]], None], weights: Sequence[str] = ()) -> None:
        """Propose labels where they are missing; a proposal that was stopped goes on.

        Args:
            label: Function that runs `trifuse label` with some words.
            weights: Flags that name a model file other than that of this package.
        """
        if not self.is_labelled:
            words = [] if self.sequence is None else ["--sequence", self.sequence]
            label([str(self.path), "--out", str(self.proposals), "--resume", *words, *weights])


def open_adapted(
    paths: Sequence[Path],
    sequence: str | None,
    learned: LearnedLabels,
    out: Path,
    *,
    images: bool,
) -> list[AdaptedDrive]:
    """Open the drives of some paths.

    Args:
        paths: Paths of drives.
        sequence: Only sequence of each; None for all.
        learned: Labels of the drives where there are some, or proposals for all.
        out: Folder of the results, in which proposals are made.
        images: Whether images are learned.

    Raises:
        DriveError: A path holds no drive.
        UsageError: A drive has no sequence of frames, or two have one name.
    """
    result = []
    for path in paths:
        for name in sequences_in(path) if sequence is None else [sequence]:
            drive = open_drive(path, sequence=name, images=images)
            if not drive.is_sequence:
                expected = "frames that follow each other in time"
                raise UsageError(path, expected=expected, found="single frames")
            has_own = learned == "labels" and drive.has_labels
            folder = None if has_own else out / "labels" / drive.name
            result.append(AdaptedDrive(path, name, drive, folder))
    names = [_SYNTHETIC_NAME, *(one.drive.name for one in result)]
    if len({*names}) < len(names):
        raise UsageError(
            "drives",
            expected=f"one of each name, and none called {_SYNTHETIC_NAME}",
            found=", ".join(names[1:]),
        )
    return result
