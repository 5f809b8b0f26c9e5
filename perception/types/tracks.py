"""Tracks of moving objects."""

from dataclasses import dataclass
from typing import Annotated

from perception.types.arrays import Bool, Float64, Int
from perception.types.boxes import Boxes3D
from perception.types.table import ArrayTable


@dataclass(frozen=True)
class Tracks(ArrayTable):
    """T tracked objects at the time of one scan, in the LiDAR frame of that scan.

    Attributes:
        ids: (T,) rising; an id is never used again.
        boxes: (T)
        velocities_m_s: (T, 2) over the ground, not relative to the vehicle, along x and y of the LiDAR frame.
        is_observed: (T,) whether the object was observed in this scan, or is predicted.
    """

    ids: Int
    boxes: Boxes3D
    velocities_m_s: Annotated[Float64, 2]
    is_observed: Bool
