"""Object to track: its first box, from a label or from seven numbers."""

import re
from dataclasses import dataclass

import numpy as np

from data.derived.object_truth import DriveObjects
from data.recorded_drive import RecordedDrive
from perception.errors import DriveError, UsageError
from perception.evaluation.single_object.track import TrueTrack
from perception.types import Boxes3D

_BOX_FIELDS = ("x", "y", "z", "length", "width", "height", "yaw")


@dataclass(frozen=True)
class TrackStart:
    """First box of a tracked object.

    Attributes:
        frame: Index of the start frame.
        box_velo: One box in the LiDAR frame of that frame.
        object_id: Track id of the label; 0 without a label.
        kind: KITTI type of the label; None without a label.
        truth: Labelled track of the object; None without a label.
    """

    frame: int
    box_velo: Boxes3D
    object_id: int = 0
    kind: str | None = None
    truth: TrueTrack | None = None

    @property
    def name(self) -> str:
        """Name of the object in tables and files."""
        return "the object" if self.kind is None else f"track {self.object_id} ({self.kind})"


@dataclass(frozen=True)
class TrackStartConfig:
    """Object to track, as named by the user: by its label or by its box.

    Attributes:
        track_id: Track id of the label, or None.
        box: Box as text, or None.
        frame: Index of the start frame; None for the first that fits.
    """

    track_id: int | None = None
    box: str | None = None
    frame: int | None = None

    def __post_init__(self) -> None:
        """Validate that there is one name of the object, and a frame that can exist."""
        if (self.track_id is None) == (self.box is None):
            found = "neither" if self.box is None else "both"
            raise UsageError("object to track", expected="either --track-id or --box", found=found)
        if self.frame is not None and self.frame < 0:
            raise UsageError("--start-frame", expected="0 or more", found=str(self.frame))


def find_start(drive: RecordedDrive, config: TrackStartConfig) -> TrackStart:
    """Find the object in a drive.

    Args:
        drive: Drive to track in.
        config: Name of the object.

    Raises:
        DriveError: the frames are no sequence, or the drive has no labels and one is named.
        UsageError: there is no such object, or no such frame.
    """
    if not drive.is_sequence:
        raise DriveError(
            drive.root, expected="a sequence of frames to track an object in", found="object frames"
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
        known = ", ".join(f"{number} ({one.kind})" for number, one in tracks.items())
        raise UsageError(
            "--track-id",
            expected=f"a labelled object of {labelled.sequence}: {known or 'there is none'}",
            found=str(track_id),
        )
    target = tracks[track_id]
    truth = labelled.track(target)
    (rows,) = np.nonzero(truth.frames == frame) if frame is not None else ([0],)
    if not len(rows):
        frames = f"{target.first_frame} to {target.last_frame}"
        raise UsageError(
            "--start-frame",
            expected=f"a frame in which track {track_id} is labelled, of {frames}",
            found=str(frame),
        )
    row = int(rows[0])
    return TrackStart(
        frame=int(truth.frames[row]),
        box_velo=truth.boxes_velo[row : row + 1],
        object_id=track_id,
        kind=target.kind,
        truth=truth,
    )


def parse_box(text: str) -> Boxes3D:
    """Parse one box from seven numbers, separated by commas or blanks.

    Args:
        text: Centre of the bottom face x y z in the LiDAR frame, length, width, height, yaw.

    Raises:
        UsageError: these are not seven finite numbers, or a size is not above zero.
    """
    words = re.split(r"[\s,]+", text.strip("[]() "))
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != len(_BOX_FIELDS) or not np.isfinite(numbers).all():
        fields = ",".join(_BOX_FIELDS)
        raise UsageError(
            "--box", expected=f"{fields}: seven numbers in metres and radians", found=repr(text)
        )
    if (numbers[3:6] <= 0).any():
        raise UsageError("--box", expected="length, width and height above 0", found=repr(text))
    return Boxes3D(numbers[None, :3], numbers[None, 3:6], numbers[6:])
