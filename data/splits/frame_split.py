"""A split: the frames of labelled drives that train, validate and test networks, by their names."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from data.open_drive import open_drives
from data.recorded_drive import RecordedDrive
from data.splits.parts import PARTS, Part, SplitBy
from perception.errors import DriveError, UsageError
from perception.evaluation.report import Column
from perception.types import Progress

_MAX_LISTED = 4  # drives in an error


@dataclass(frozen=True)
class PartCounts:
    """What a part of a split holds.

    Attributes:
        frames: Number of frames.
        drives: Number of drives that these are of.
        cars: Number of labelled cars in them.
    """

    frames: int
    drives: int
    cars: int

    @classmethod
    def of(cls, drives: Sequence[RecordedDrive], progress: Progress) -> "PartCounts":
        """Count the frames and the labelled cars of drives.

        Args:
            drives: Drives with the frames of the part.
            progress: Wrapper of the loop over frames.

        Raises:
            PerceptionError: A label cannot be read, or a drive has none.
        """
        frames = [(drive, index) for drive in drives for index in range(len(drive))]
        cars = 0
        for number in progress(range(len(frames))):
            drive, index = frames[number]
            cars += int((drive.labels(index).types == "Car").sum())
        return cls(sum(map(len, drives)), len(drives), cars)


COLUMNS = [
    Column[PartCounts]("frames", lambda row: row.frames, "d"),
    Column[PartCounts]("drives", lambda row: row.drives, "d"),
    Column[PartCounts]("labelled cars", lambda row: row.cars, "d"),
]


@dataclass(frozen=True)
class DriveParts:
    """Frames of one drive.

    Attributes:
        root: Folder of the drive, or of all sequences.
        name: Name of the drive or sequence.
        frames: Names of the frames of each part.
    """

    root: Path
    name: str
    frames: Mapping[Part, tuple[str, ...]]

    def __post_init__(self) -> None:
        """Validate that no frame is in two parts."""
        part_of: dict[str, Part] = {}
        for part, names in self.frames.items():
            for name in names:
                if part_of.setdefault(name, part) != part:
                    raise UsageError(
                        f"split of {self.name}",
                        expected="each frame in one part",
                        found=f"{name} in {part_of[name]} and {part}",
                    )


@dataclass(frozen=True)
class FrameSplit:
    """Frames of several drives, each in at most one part.

    Attributes:
        drives: Frames of each drive.
        by: Unit that was drawn; None where lists of frames were read.
        shares: Percentage of each part that was drawn.
        seed: Seed of the draw.
        file: File that holds the split, or None.
    """

    drives: tuple[DriveParts, ...]
    by: SplitBy | None = None
    shares: tuple[float, ...] = ()
    seed: int | None = None
    file: Path | None = None

    @property
    def source(self) -> str:
        """File of the split, in words."""
        return "the split" if self.file is None else str(self.file)

    @property
    def parts(self) -> tuple[Part, ...]:
        """Parts that have frames."""
        return tuple(part for part in PARTS if any(one.frames.get(part) for one in self.drives))

    @property
    def fingerprint(self) -> str:
        """Hash of the names of drives and frames; where the drives lie does not matter."""
        frames = [
            (one.name, [sorted(one.frames.get(part, ())) for part in PARTS]) for one in self.drives
        ]
        content = json.dumps(sorted(frames)).encode()
        return hashlib.blake2b(content, digest_size=8).hexdigest()

    def open(self, paths: Sequence[Path] = (), *, images: bool = True) -> list[RecordedDrive]:
        """Open those drives of some folders of which this is a split.

        Args:
            paths: Folders, such as a copy of the data; none for those that the split names.
            images: Whether frames carry images.

        Raises:
            UsageError: This is no split of any drive of a folder.
            DriveError: A folder holds no drive, or a drive of the split is not there.
        """
        if not paths:
            return [self._open(one, images=images) for one in self.drives]
        found = []
        for path in paths:
            drives = open_drives([path], images=images)
            known = [drive for drive in drives if self._parts_of(drive) is not None]
            if not known:
                raise self._foreign(drives)
            found += known
        return found

    def select(self, drives: Iterable[RecordedDrive], *parts: Part) -> list[RecordedDrive]:
        """Return the drives with the frames of some parts alone, without those that have none.

        Raises:
            DriveError: A drive lacks a frame of the parts.
        """
        selected = []
        for drive in drives:
            of_drive = self._parts_of(drive)
            frames = {} if of_drive is None else of_drive.frames
            if names := [name for part in parts for name in frames.get(part, ())]:
                selected.append(drive.select(self._indices(drive, names)))
        return selected

    def require_part(self, drives: Sequence[RecordedDrive], part: Part) -> list[RecordedDrive]:
        """Return what `select` does, of drives of which there must be frames in the part.

        Raises:
            UsageError: This is no split of the drives, or has no frame of them in the part.
            DriveError: A drive lacks a frame of the part.
        """
        selected = self.select(drives, part)
        if selected:
            return selected
        if not any(self._parts_of(drive) for drive in drives):
            raise self._foreign(drives)
        raise UsageError(
            f"--part {part}",
            expected=f"a part that has frames of {_names(drives)} in {self.source}",
            found=f"none; it has {', '.join(self.parts)}",
            advice="name another part, or other drives",
        )

    def _open(self, parts: DriveParts, *, images: bool) -> RecordedDrive:
        for drive in open_drives([parts.root], images=images):
            if drive.name == parts.name:
                return drive
        raise DriveError(
            parts.root,
            expected=f"drive {parts.name}, as {self.source} says",
            found="none of this name",
            advice="name the folders of the drives beside the split",
        )

    def _parts_of(self, drive: RecordedDrive) -> DriveParts | None:
        """Return the frames of a drive: of its name, and of its folder where several have the name."""
        found = [one for one in self.drives if one.name == drive.name]
        if len(found) > 1:
            found = [one for one in found if one.root.resolve() == drive.root.resolve()]
        return found[0] if found else None

    def _indices(self, drive: RecordedDrive, names: Sequence[str]) -> list[int]:
        index_of = {name: index for index, name in enumerate(drive.frame_names)}
        missing = [name for name in names if name not in index_of]
        if missing:
            raise DriveError(
                drive.root,
                expected=f"{len(names)} frames that {self.source} names",
                found=f"{len(missing)} of them missing, {missing[0]} the first",
                advice="copy them there, or split the folder again with: trifuse split",
            )
        return sorted(index_of[name] for name in names)

    def _foreign(self, drives: Sequence[RecordedDrive]) -> UsageError:
        return UsageError(
            self.source,
            expected=f"a split of {_names(drives)}",
            found=f"one of {', '.join(one.name for one in self.drives[:_MAX_LISTED])}",
            advice="split this folder with: trifuse split",
        )


def _names(drives: Sequence[RecordedDrive]) -> str:
    return ", ".join(f"{drive.name} in {drive.root}" for drive in drives[:_MAX_LISTED])
