"""What each part of a split holds."""

from collections.abc import Sequence
from dataclasses import dataclass

from data.recorded_drive import RecordedDrive
from perception.evaluation.report import Column
from perception.types import Progress


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
