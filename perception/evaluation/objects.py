"""Labelled objects of one frame and their motion."""

from dataclasses import dataclass
from enum import IntEnum

from perception.errors import PerceptionError
from perception.types import Boxes3D, Int


class MotionState(IntEnum):
    """Motion of a labelled object at one moment."""

    UNKNOWN = 0  # too short a track, or a speed that the labels cannot distinguish from zero
    STATIC = 1
    MOVING = 2


@dataclass(frozen=True)
class LabelledObjects:
    """M labelled objects of one frame.

    Attributes:
        boxes_velo: (M) 3D boxes in the LiDAR frame.
        motions: (M,) `MotionState` of each object.
        track_ids: (M,) Track id, -1 where the labels have no tracks.
    """

    boxes_velo: Boxes3D
    motions: Int
    track_ids: Int

    def __post_init__(self) -> None:
        """Validate that the arrays have one length."""
        lengths = {len(self.boxes_velo), len(self.motions), len(self.track_ids)}
        if len(lengths) > 1:
            raise PerceptionError(
                "LabelledObjects", expected="arrays of one length", found=f"lengths {lengths}"
            )

    def __len__(self) -> int:
        """Return M."""
        return len(self.boxes_velo)
