"""Labelled objects of one frame and their motion."""

from dataclasses import dataclass
from enum import IntEnum

from perception.types import ArrayTable, Boxes3D, Int


class MotionState(IntEnum):
    """Motion of a labelled object at one moment."""

    UNKNOWN = 0  # too short a track, or a speed that the labels cannot distinguish from zero
    STATIC = 1
    MOVING = 2


@dataclass(frozen=True)
class LabelledObjects(ArrayTable):
    """M labelled objects of one frame.

    Attributes:
        boxes_velo: (M) 3D boxes in the LiDAR frame.
        motions: (M,) `MotionState` of each object.
        track_ids: (M,) Track id, -1 where the labels have no tracks.
    """

    boxes_velo: Boxes3D
    motions: Int
    track_ids: Int
