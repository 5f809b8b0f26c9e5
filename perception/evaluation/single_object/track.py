"""One object as it was, and as a tracker followed it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from perception.errors import PerceptionError
from perception.tracking.single_object.tracker import TrackedObject
from perception.types import Boxes3D, Float64, Int

_NO_BOX = Boxes3D(np.full((1, 3), np.nan), np.full((1, 3), np.nan), np.full(1, np.nan))


@dataclass(frozen=True)
class ObjectSequence:
    """One object to track, with its frames.

    Attributes:
        name: Name of the sequence in its table.
        sequence: Sequence of KITTI's tracking benchmark, such as "0000".
        track_id: Track id of the object.
        kind: KITTI's class name.
        first_frame: Frame in which the tracker is initialised with the object's box.
        last_frame: Last frame in which the object is tracked.
        stated: Other columns of the table: scene, object_status, ego_status ...
    """

    name: str
    sequence: str
    track_id: int
    kind: str
    first_frame: int
    last_frame: int
    stated: Mapping[str, str] = field(default_factory=dict)

    @property
    def frame_count(self) -> int:
        """Number of frames."""
        return self.last_frame - self.first_frame + 1


@dataclass(frozen=True)
class TrueTrack:
    """An object in the K frames in which it is labelled.

    Attributes:
        frames: (K,) numbers of the frames, rising.
        stamps_s: (K,) times of their scans.
        boxes_velo: (K) in the LiDAR frame of each scan.
        boxes_px: (K, 4) x1 y1 x2 y2 in the image; NaN where the camera does not see it.
        velocities_m_s: (K, 2) over the ground, along x and y of the LiDAR frame; NaN where unknown.
        occlusion: (K,) 0 visible, 1 partly, 2 largely or fully occluded, 3 unknown.
    """

    frames: Int
    stamps_s: Float64
    boxes_velo: Boxes3D
    boxes_px: Float64
    velocities_m_s: Float64
    occlusion: Int

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        columns = (self.stamps_s, self.boxes_velo, self.boxes_px, self.velocities_m_s)
        _require_length("TrueTrack", len(self.frames), [*columns, self.occlusion])

    def __len__(self) -> int:
        """Return K."""
        return len(self.frames)

    def __getitem__(self, rows: Int | slice) -> "TrueTrack":
        """Return the frames of indices or of a slice."""
        return TrueTrack(
            self.frames[rows],
            self.stamps_s[rows],
            self.boxes_velo[rows],
            self.boxes_px[rows],
            self.velocities_m_s[rows],
            self.occlusion[rows],
        )


@dataclass(frozen=True)
class PredictedTrack:
    """What a tracker answered in F frames, the first of which told it the object's box.

    Attributes:
        frames: (F,) numbers of the frames, rising.
        states: (F,) one `TrackStatus` each.
        boxes_velo: (F) in the LiDAR frame of each scan; NaN where the tracker gave none.
        boxes_px: (F, 4) as the tracker gave them; NaN where it gave none.
        velocities_m_s: (F, 2).
        seconds: (F,) that each answer took.
    """

    frames: Int
    states: np.ndarray
    boxes_velo: Boxes3D
    boxes_px: Float64
    velocities_m_s: Float64
    seconds: Float64

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        columns = (self.states, self.boxes_velo, self.boxes_px, self.velocities_m_s)
        _require_length("PredictedTrack", len(self.frames), [*columns, self.seconds])

    def __len__(self) -> int:
        """Return F."""
        return len(self.frames)

    @classmethod
    def from_predictions(
        cls, frames: Sequence[int], predictions: Sequence[TrackedObject], seconds: Sequence[float]
    ) -> "PredictedTrack":
        """Gather the answers of a tracker, frame by frame."""
        boxes = [_NO_BOX if one.box_velo is None else one.box_velo for one in predictions]
        boxes_px = [np.full(4, np.nan) if one.box_px is None else one.box_px for one in predictions]
        return cls(
            frames=np.array(frames, np.int64),
            states=np.array([one.state for one in predictions], np.str_),
            boxes_velo=Boxes3D(
                np.array([box.bottom_m for box in boxes], np.float64).reshape(-1, 3),
                np.array([box.size_m for box in boxes], np.float64).reshape(-1, 3),
                np.array([box.yaw_rad for box in boxes], np.float64).reshape(-1),
            ),
            boxes_px=np.array(boxes_px, np.float64).reshape(-1, 4),
            velocities_m_s=np.array([one.velocity_m_s for one in predictions]).reshape(-1, 2),
            seconds=np.array(seconds, np.float64),
        )


def _require_length(what: str, length: int, columns: Sequence[Boxes3D | np.ndarray]) -> None:
    lengths = {length, *map(len, columns)}
    if len(lengths) > 1:
        raise PerceptionError(
            what, expected="arrays of one length", found=f"lengths {sorted(lengths)}"
        )
