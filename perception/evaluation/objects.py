"""The labelled objects of one frame, as the obstacle evaluation needs them."""

from dataclasses import dataclass
from enum import IntEnum

from perception.errors import PerceptionError
from perception.types import Boxes3D, Int


class MotionState(IntEnum):
    """What the labels say of an object at one moment."""

    UNKNOWN = (
        0  # seen too briefly, or creeping at a speed that the labels cannot tell from standing
    )
    STATIC = 1
    MOVING = 2


@dataclass(frozen=True)
class LabelledObjects:
    """M labelled objects of one frame.

    Attributes:
        boxes_velo: (M) 3D boxes in the LiDAR frame.
        motions: (M,) one `Motion` each.
        track_ids: (M,) -1 where the labels have no tracks.
    """

    boxes_velo: Boxes3D
    motions: Int
    track_ids: Int

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        lengths = {len(self.boxes_velo), len(self.motions), len(self.track_ids)}
        if len(lengths) > 1:
            raise PerceptionError(
                "LabelledObjects", expected="arrays of one length", found=f"lengths {lengths}"
            )

    def __len__(self) -> int:
        """Return M."""
        return len(self.boxes_velo)
