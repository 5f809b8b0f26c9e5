"""What moves, as objects with an identity."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.types.arrays import Bool, Float64, Int, require_shape
from perception.types.boxes import Boxes3D


@dataclass(frozen=True)
class Tracks:
    """T objects followed over time, as they are at the moment of one scan, in the LiDAR frame of that scan.

    Attributes:
        ids: (T,) rising; a tracker never gives one twice.
        boxes: (T)
        velocities_m_s: (T, 2) over the ground, not relative to the vehicle, along x and y of the LiDAR frame.
        is_observed: (T,) measured in this scan; the others are predicted.
    """

    ids: Int
    boxes: Boxes3D
    velocities_m_s: Float64
    is_observed: Bool

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        count = len(self.ids)
        require_shape("Tracks.boxes.yaw_rad", self.boxes.yaw_rad, (count,))
        require_shape("Tracks.velocities_m_s", self.velocities_m_s, (count, 2))
        require_shape("Tracks.is_observed", self.is_observed, (count,))

    def __len__(self) -> int:
        """Return T."""
        return len(self.ids)

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the tracks of a mask, of indices, or of a slice."""
        return type(self)(
            self.ids[rows], self.boxes[rows], self.velocities_m_s[rows], self.is_observed[rows]
        )

    @classmethod
    def empty(cls) -> Self:
        """Return no tracks."""
        return cls(np.zeros(0, np.int64), Boxes3D.empty(), np.zeros((0, 2)), np.zeros(0, bool))
