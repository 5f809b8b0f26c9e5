"""Upright boxes in space."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.types.arrays import Bool, Float64, Int, require_shape


@dataclass(frozen=True)
class Boxes3D:
    """M upright boxes in one frame, the LiDAR's unless the variable's name says otherwise.

             front
          +---^---+      bottom_m: centre of the bottom face
          |   |   |      size_m:   length (along the heading), width, height
    left  |   o   |      yaw_rad:  of the heading, from +x towards +y
          +-------+

    """

    bottom_m: Float64
    size_m: Float64
    yaw_rad: Float64

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        require_shape("Boxes3D.bottom_m", self.bottom_m, ("M", 3))
        require_shape("Boxes3D.size_m", self.size_m, (len(self.bottom_m), 3))
        require_shape("Boxes3D.yaw_rad", self.yaw_rad, (len(self.bottom_m),))

    def __len__(self) -> int:
        """Return M."""
        return len(self.bottom_m)

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the boxes of a mask, of indices, or of a slice."""
        return type(self)(self.bottom_m[rows], self.size_m[rows], self.yaw_rad[rows])

    @classmethod
    def empty(cls) -> Self:
        """Return no boxes."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
