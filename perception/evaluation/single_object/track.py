"""Tracks of one object: the true one, and the one that a tracker predicts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from perception.tracking.single_object.tracker import TrackedObject
from perception.types import ArrayTable, Boxes3D, Float64, Int

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
        printed: Errors that the thesis prints, by the name of the metric, then by tracker; a tracker that failed
            is left out.
    """

    name: str
    sequence: str
    track_id: int
    kind: str
    first_frame: int
    last_frame: int
    stated: Mapping[str, str] = field(default_factory=dict)
    printed: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def frame_count(self) -> int:
        """Number of frames."""
        return self.last_frame - self.first_frame + 1

    @property
    def frame_range(self) -> str:
        """First and last frame."""
        return f"{self.first_frame}-{self.last_frame}"


@dataclass(frozen=True)
class TrueTrack(ArrayTable):
    """An object in the K frames in which it is labelled.

    Attributes:
        frames: (K,) Numbers of the frames in ascending order.
        stamps_s: (K,) Times of the scans.
        boxes_velo: (K) Boxes in the LiDAR frame of each scan.
        boxes_px: (K, 4) Boxes x1 y1 x2 y2 in the image; NaN where the object is not in the image.
        velocities_m_s: (K, 2) Velocity over the ground along x and y of the LiDAR frame; NaN where unknown.
        occlusion: (K,) 0 visible, 1 partly, 2 largely or fully occluded, 3 unknown.
    """

    frames: Int
    stamps_s: Float64
    boxes_velo: Boxes3D
    boxes_px: Annotated[Float64, 4]
    velocities_m_s: Annotated[Float64, 2]
    occlusion: Int


@dataclass(frozen=True)
class TargetObject:
    """Object to track in the available frames of a drive.

    Attributes:
        sequence: Object and its frames, as far as they are available.
        truth: Labelled or exact track of the object.
        total_frames: Number of frames of the sequence if all of them were available.
    """

    sequence: ObjectSequence
    truth: TrueTrack
    total_frames: int


@dataclass(frozen=True)
class PredictedTrack(ArrayTable):
    """Predictions of a tracker in F frames, initialised with the object's box in the first of them.

    Attributes:
        frames: (F,) Numbers of the frames in ascending order.
        states: (F,) `TrackStatus` of each frame.
        boxes_velo: (F) Boxes in the LiDAR frame of each scan; NaN without a prediction.
        boxes_px: (F, 4) Boxes x1 y1 x2 y2 in the image as the tracker predicts them; NaN without a prediction.
        velocities_m_s: (F, 2) Velocity over the ground along x and y of the LiDAR frame.
        seconds: (F,) Time of each prediction in s.
    """

    frames: Int
    states: np.ndarray
    boxes_velo: Boxes3D
    boxes_px: Annotated[Float64, 4]
    velocities_m_s: Annotated[Float64, 2]
    seconds: Float64

    @classmethod
    def from_predictions(
        cls, frames: Sequence[int], predictions: Sequence[TrackedObject], seconds: Sequence[float]
    ) -> "PredictedTrack":
        """Return the predictions of a tracker, frame by frame, as a table."""
        boxes = [_NO_BOX if one.box_velo is None else one.box_velo for one in predictions]
        boxes_px = [np.full(4, np.nan) if one.box_px is None else one.box_px for one in predictions]
        return cls(
            frames=np.array(frames, np.int64),
            states=np.array([one.status for one in predictions], np.str_),
            boxes_velo=Boxes3D.concatenate(boxes),
            boxes_px=np.array(boxes_px, np.float64).reshape(-1, 4),
            velocities_m_s=np.array([one.velocity_m_s for one in predictions]).reshape(-1, 2),
            seconds=np.array(seconds, np.float64),
        )
