"""Upright boxes in space."""

from dataclasses import dataclass
from typing import Annotated

from perception.types.arrays import Float64
from perception.types.table import ArrayTable


@dataclass(frozen=True)
class Boxes3D(ArrayTable):
    """M upright boxes in one frame, the LiDAR frame unless the variable's name states another.

             front
          +---^---+
          |   |   |
    left  |   o   |
          +-------+

    Attributes:
        bottom_m: (M, 3) centre of the bottom face.
        size_m: (M, 3) length (along the heading), width, height.
        yaw_rad: (M,) heading, from +x towards +y.
    """

    bottom_m: Annotated[Float64, 3]
    size_m: Annotated[Float64, 3]
    yaw_rad: Float64
