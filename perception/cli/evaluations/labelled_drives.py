"""Labelled drives once through something that looks at their frames: what it says, and what is true."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from data.frames import OnBadFrame, file_number
from data.kitti.detection_rows import DetectionSet
from data.open_drive import open_drive, sequences_in
from data.true_boxes import true_boxes
from perception.cli.flags import require_drives, require_positive
from perception.cli.vehicle_detector import outputs
from perception.errors import DriveError
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.types import Detections, Drive, Frame, Labels

Output = TypeVar("Output")


@dataclass(frozen=True)
class LabelledDrive:
    """Which frames the figures are of.

    Attributes:
        name: as asked for.
        root: folder.
        sensor: name of the LiDAR model.
        is_synthetic: whether the truth of every point is known, which it is of no recorded drive.
        frames: how many the drive has.
        frames_evaluated: how many of those asked for could be read.
    """

    name: str
    root: Path
    sensor: str
    is_synthetic: bool
    frames: int
    frames_evaluated: int

    @property
    def kind(self) -> str:
        """Whether the drive is real."""
        return "synthetic" if self.is_synthetic else "real"


@dataclass(frozen=True)
class DetectedDrive(Generic[Output]):
    """What is true of F frames, and what was made of each.

    Attributes:
        data: which frames.
        numbers: (F) by which their files are named.
        truths: labelled boxes; frames are counted by their place.
        outputs: (F) what was made of them.
    """

    data: LabelledDrive
    numbers: tuple[int, ...]
    truths: TrueBoxes
    outputs: tuple[Output, ...]

    def with_labels(self, detections: Sequence[Detections]) -> DetectionSet:
        """Put the detections of the F frames beside what is true."""
        found = DetectedBoxes.of_frames(detections)
        return DetectionSet(self.numbers, self.truths, found, missing_results=(), extra_results=())


@dataclass(frozen=True)
class DriveSource:
    """Where a drive lies.

    Attributes:
        name: of the drive in the figures.
        path: as asked for.
        sequence: which one of a tracking folder.
    """

    name: str
    path: Path
    sequence: str | None


@dataclass(frozen=True)
class ReadingConfig:
    """How drives are read.

    Attributes:
        sequence: which one of a tracking folder; else each of them for itself.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        frames: of each drive only so many from the start; else all.
        on_bad_frame: stop at a damaged frame, or skip it and say so.
        images: whether frames carry images.
    """

    sequence: str | None = None
    sensor: str | None = None
    frames: int | None = None
    on_bad_frame: OnBadFrame = "stop"
    images: bool = True

    def __post_init__(self) -> None:
        """Refuse no frame at all."""
        require_positive("--frames", self.frames)


def drive_sources(paths: Sequence[Path], sequence: str | None) -> Iterator[DriveSource]:
    """Name every drive of every path; a sequence is asked of those that have several.

    Raises:
        UsageError: there is no path.
        DriveError: one holds no drive.
    """
    require_drives(paths)
    for path in paths:
        names = sequences_in(path)
        if names == [None] or sequence is not None:
            asked = sequence if names != [None] or len(paths) == 1 else None
            yield DriveSource(" ".join(filter(None, (str(path), asked))), path, asked)
            continue
        for name in names:
            yield DriveSource(f"{path} {name}", path, name)


def open_labelled(source: DriveSource, config: ReadingConfig) -> Drive:
    """Open a drive that has labelled boxes.

    Raises:
        DriveError: it has none.
    """
    drive = open_drive(
        source.path, sequence=source.sequence, sensor=config.sensor, images=config.images
    )
    if not drive.has_labels:
        raise DriveError(
            drive.root,
            expected="labelled boxes to measure against",
            found="none in this drive",
            advice="name the same drive in the tracking or object layout",
        )
    return drive


def detect_drive(
    name: str, drive: Drive, detect: Callable[[Frame], Output], config: ReadingConfig
) -> DetectedDrive[Output]:
    """Look at the frames of a drive, and put their labels beside.

    Args:
        name: of the drive in the figures.
        drive: what is read.
        detect: what is made of a frame, and kept.
        config: which frames.

    Raises:
        PerceptionError: a frame or its labels cannot be read or used, or no frame can.
    """
    indices: list[int] = []
    labels: list[Labels] = []
    detected: list[Output] = []
    for frame, one in outputs(drive, detect, limit=config.frames, on_bad_frame=config.on_bad_frame):
        indices.append(frame.index)
        labels.append(drive.labels(frame.index))
        detected.append(one)
    if not detected:
        raise DriveError(drive.root, expected="a frame that can be read", found="none")
    data = LabelledDrive(
        name=name,
        root=drive.root.resolve(),
        sensor=drive.sensor.name,
        is_synthetic=drive.point_truth(indices[0]) is not None,
        frames=len(drive),
        frames_evaluated=len(detected),
    )
    numbers = tuple(file_number(drive, index) for index in indices)
    return DetectedDrive(data, numbers, true_boxes(labels), tuple(detected))
