"""Frames and labels of the drives of a search, in chunks that any process can read."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from data.open_drive import open_drive, sequences_in
from data.samples.labelled_parts import require_classes
from perception.errors import DriveError, UsageError
from perception.types import Bool, Drive, Labels, Progress

_open = lru_cache(maxsize=16)(open_drive)


@dataclass(frozen=True)
class FrameSet:
    """Frames of a drive, as another process can read them.

    Attributes:
        path: Path as `open_drive` takes it.
        sequence: Sequence, where the path holds several.
        frames: Indices of the frames.
    """

    path: Path
    sequence: str | None
    frames: tuple[int, ...]

    def open(self) -> Drive:
        """Open the drive with its images, from which some drives know the image size."""
        return _open(self.path, sequence=self.sequence)


@dataclass(frozen=True)
class Survey:
    """All drives, with the numbers of their labels.

    Attributes:
        drives: Frames of each drive.
        labels: Number of labels of each drive, by type in lower case.
        of_class: Class of the objects.
    """

    drives: tuple[FrameSet, ...]
    labels: tuple[Mapping[str, int], ...]
    of_class: str

    def __post_init__(self) -> None:
        """Validate that there are objects of the class."""
        labels = sum(map(Counter, self.labels), Counter[str]())
        names = ", ".join(str(drive.path) for drive in self.drives)
        require_classes([self.of_class], labels, f"labels of {names}")

    @property
    def frames(self) -> int:
        """Number of frames."""
        return sum(len(drive.frames) for drive in self.drives)

    @property
    def objects(self) -> tuple[int, ...]:
        """Number of objects of the class in each drive."""
        return tuple(of_drive.get(self.of_class.lower(), 0) for of_drive in self.labels)

    def chunks(self, frames: int) -> list[FrameSet]:
        """Cut every drive into chunks of frames."""
        return [
            replace(drive, frames=drive.frames[first : first + frames])
            for drive in self.drives
            for first in range(0, len(drive.frames), frames)
        ]


def survey(
    paths: Sequence[Path], of_class: str, *, every: int = 1, progress: Progress = iter
) -> Survey:
    """Read all labels.

    Args:
        paths: Drives, or folders of drives or sequences, all of which are taken.
        of_class: Class of the objects, in any case.
        every: Stride of the frames of each drive.
        progress: Wrapper of the loop over frames that may show its progress.

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
    drives, labels = [], []
    for path in resolved:
        for sequence in sequences_in(path):
            drive = open_drive(path, sequence=sequence, images=False)
            frames = tuple(range(0, len(drive), every))
            drives.append(FrameSet(path, sequence, frames))
            labels.append(_count_types(drive, progress(frames)))
    return Survey(tuple(drives), tuple(labels), of_class)


def is_of_class(labels: Labels, of_class: str) -> Bool:
    """Return (M,) which objects are of a class, in any case."""
    return np.asarray(np.char.lower(labels.types.astype(np.str_)) == of_class.lower())


def _count_types(drive: Drive, frames: Iterable[int]) -> Mapping[str, int]:
    if not drive.has_labels:
        raise DriveError(drive.root, expected="labels to search by", found="none")
    return Counter(
        str(name).lower() for index in frames for name in drive.labels(index).types.tolist()
    )
