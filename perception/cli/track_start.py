"""Which object is followed, and from where: told by its label, or by its box."""

import re
from dataclasses import dataclass

import numpy as np

from data.derived.object_truth import DriveObjects
from data.derived.single_object import ObjectSequence
from data.kitti.objects import ObjectFrames
from data.kitti.sequence import KittiSequence
from perception.errors import DriveError, UsageError
from perception.evaluation.single_object.track import TrueTrack
from perception.types import Boxes3D

_BOX_NUMBERS = ("x", "y", "z", "length", "width", "height", "yaw")


@dataclass(frozen=True)
class TrackStart:
    """What a tracker of one object is told.

    Attributes:
        frame: in which it begins.
        box_velo: one box in the LiDAR frame of that frame.
        object_id: of the label, 0 without one.
        kind: KITTI's type of the label, or None without one.
        truth: the labelled object, or None where nobody labelled it.
    """

    frame: int
    box_velo: Boxes3D
    object_id: int = 0
    kind: str | None = None
    truth: TrueTrack | None = None

    @property
    def name(self) -> str:
        """What the object is called."""
        return "the object" if self.kind is None else f"track {self.object_id} ({self.kind})"


@dataclass(frozen=True)
class TrackStartConfig:
    """How a user names the object.

    Attributes:
        track_id: of its label, or None.
        box: its box as text, or None.
        frame: in which it is; None for the first that fits.
    """

    track_id: int | None = None
    box: str | None = None
    frame: int | None = None

    def __post_init__(self) -> None:
        """Refuse neither, both, and frames before the first."""
        if (self.track_id is None) == (self.box is None):
            found = "neither" if self.box is None else "both"
            raise UsageError(
                "the object to follow", expected="either --track-id or --box", found=found
            )
        if self.frame is not None and self.frame < 0:
            raise UsageError("--start-frame", expected="0 or more", found=str(self.frame))


def find_start(drive: KittiSequence | ObjectFrames, config: TrackStartConfig) -> TrackStart:
    """Find the object in a drive.

    Raises:
        DriveError: the drive's frames do not follow each other, or it has no labels where one is named.
        UsageError: there is no such object, or no such frame.
    """
    if isinstance(drive, ObjectFrames):
        raise DriveError(
            drive.root,
            expected="frames that follow each other, to follow an object through them",
            found="object frames",
        )
    if config.frame is not None and config.frame >= len(drive):
        raise UsageError(
            "--start-frame",
            expected=f"a frame of {drive.name}, 0 to {len(drive) - 1}",
            found=str(config.frame),
        )
    if config.box is not None:
        return TrackStart(config.frame or 0, parse_box(config.box))
    assert config.track_id is not None
    return _labelled_start(DriveObjects.of(drive), config.track_id, config.frame)


def _labelled_start(labelled: DriveObjects, track_id: int, frame: int | None) -> TrackStart:
    tracks = {one.track_id: one for one in labelled.sequences(min_frames=1)}
    if track_id not in tracks:
        there = ", ".join(f"{number} ({one.kind})" for number, one in tracks.items())
        raise UsageError(
            "--track-id",
            expected=f"a labelled object of {labelled.sequence}: {there or 'there is none'}",
            found=str(track_id),
        )
    named = tracks[track_id]
    truth = labelled.track(named)
    row = 0 if frame is None else _row_of(truth, frame, named)
    return TrackStart(
        frame=int(truth.frames[row]),
        box_velo=truth.boxes_velo[row : row + 1],
        object_id=track_id,
        kind=named.kind,
        truth=truth,
    )


def _row_of(truth: TrueTrack, frame: int, named: ObjectSequence) -> int:
    rows = np.flatnonzero(truth.frames == frame)
    if not len(rows):
        raise UsageError(
            "--start-frame",
            expected=(
                f"a frame in which track {named.track_id} is labelled, of "
                f"{named.first_frame} to {named.last_frame}"
            ),
            found=str(frame),
        )
    return int(rows[0])


def parse_box(text: str) -> Boxes3D:
    """Read one box from seven numbers with commas or blanks between.

    Args:
        text: x y z of the middle of its bottom in the LiDAR frame, length, width, height, and yaw.

    Raises:
        UsageError: these are not seven finite numbers, or a size is not above zero.
    """
    words = re.split(r"[\s,]+", text.strip("[]() "))
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != len(_BOX_NUMBERS) or not np.isfinite(numbers).all():
        names = ",".join(_BOX_NUMBERS)
        raise UsageError(
            "--box", expected=f"{names}: seven numbers in metres and radians", found=repr(text)
        )
    if (numbers[3:6] <= 0).any():
        raise UsageError("--box", expected="length, width and height above 0", found=repr(text))
    return Boxes3D(numbers[None, :3], numbers[None, 3:6], numbers[6:])
