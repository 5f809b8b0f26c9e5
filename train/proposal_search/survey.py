"""What is searched over: the frames of labelled drives, cut into chunks that any process can read."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from data.drive import Drive, Labels
from data.open_drive import open_drive, sequences_in
from perception.errors import DriveError, LabelError, UsageError

Progress = Callable[[Iterable[int]], Iterable[int]]


@dataclass(frozen=True)
class LabelledDrive:
    """A drive that can be opened again, and what its labels say.

    Attributes:
        path: as `open_drive` takes it.
        sequence: which one, where the path holds several.
        frames: indices of those that are used.
        objects: how many of the class are labelled in them.
    """

    path: Path
    sequence: str | None
    frames: tuple[int, ...]
    objects: int

    def open(self) -> Drive:
        """Open the drive with its images, as some say only by them how large they are."""
        return _open(self.path, self.sequence)


@dataclass(frozen=True)
class Survey:
    """All drives, and what is looked for.

    Attributes:
        drives: one after the other.
        of_class: type of the objects that proposals have to reach.
    """

    drives: tuple[LabelledDrive, ...]
    of_class: str

    @property
    def frames(self) -> int:
        """How many frames there are."""
        return sum(len(drive.frames) for drive in self.drives)

    @property
    def objects(self) -> int:
        """How many labelled objects there are to be found."""
        return sum(drive.objects for drive in self.drives)

    def chunks(self, frames: int) -> list[LabelledDrive]:
        """Cut every drive into pieces of so many frames; their objects are not counted again."""
        return [
            replace(drive, frames=drive.frames[first : first + frames], objects=-1)
            for drive in self.drives
            for first in range(0, len(drive.frames), frames)
        ]


def survey(
    paths: Sequence[Path], of_class: str, *, every: int = 1, progress: Progress = iter
) -> Survey:
    """Read all labels.

    Args:
        paths: of drives, or of folders of tracking sequences, all of which are taken.
        of_class: type of the objects, in any case.
        every: take each such frame of a drive.
        progress: goes through the frames of a drive, and may show how far it is.

    Raises:
        DriveError: a path holds no drive, or one without labels.
        LabelError: no object of the class is labelled, or a label cannot be read.
        UsageError: a drive is named twice, or no step was asked for.
    """
    if every < 1:
        raise UsageError("--every", expected="at least 1", found=str(every))
    resolved = [path.resolve() for path in paths]
    if not resolved or len(set(resolved)) < len(resolved):
        named = ", ".join(map(str, paths)) or "none"
        raise UsageError("drives", expected="one or more, each once", found=named)
    types: list[str] = []
    drives = []
    for path in resolved:
        for sequence in sequences_in(path):
            drive = _open(path, sequence)
            if not drive.has_labels:
                raise DriveError(drive.root, expected="labels to search by", found="none")
            frames = tuple(range(0, len(drive), every))
            labels = [drive.labels(index) for index in progress(frames)]
            types += [name for of_frame in labels for name in of_frame.types.tolist()]
            count = int(sum(is_of_class(of_frame, of_class).sum() for of_frame in labels))
            drives.append(LabelledDrive(path, sequence, frames, count))
    found = Survey(tuple(drives), of_class)
    if not found.objects:
        raise LabelError(
            ", ".join(map(str, paths)),
            expected=f"labels of the class {of_class}, else there is nothing to search for",
            found=f"only {', '.join(sorted(set(types)))}" if types else "no labelled object",
        )
    return found


def is_of_class(labels: Labels, of_class: str) -> np.ndarray:
    """Return (M,) which labels are of a class, in any case."""
    return np.asarray(np.char.lower(labels.types.astype(np.str_)) == of_class.lower())


@lru_cache(maxsize=16)
def _open(path: Path, sequence: str | None) -> Drive:
    return open_drive(path, sequence=sequence)
