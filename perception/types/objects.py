"""Objects on the road: boxes, tracks and vehicles."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.types.arrays import Bool, Float64, Int, require_shape
from perception.types.detections import FusedDetections
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


@dataclass(frozen=True)
class Vehicles:
    """M detected vehicles as objects on the road, in the LiDAR frame of one scan of N points.

    Attributes:
        fused: (M) fused detections.
        ids: (M,) track ids, equal to those of `Tracks` for an object in both; -1 before confirmation.
        boxes: (M) 3D boxes on the ground; rows of NaN where the LiDAR has too few points.
        distances_m: (M,) from the LiDAR to the nearest return, NaN without one.
        velocities_m_s: (M, 2) over the ground along x and y of the LiDAR frame, NaN before it is known.
        owners: (N,) vehicle that each point belongs to, or -1.
    """

    fused: FusedDetections
    ids: Int
    boxes: Boxes3D
    distances_m: Float64
    velocities_m_s: Float64
    owners: Int

    def __post_init__(self) -> None:
        """Validate shapes and lengths."""
        count = len(self.fused)
        require_shape("Vehicles.ids", self.ids, (count,))
        require_shape("Vehicles.boxes.yaw_rad", self.boxes.yaw_rad, (count,))
        require_shape("Vehicles.distances_m", self.distances_m, (count,))
        require_shape("Vehicles.velocities_m_s", self.velocities_m_s, (count, 2))

    def __len__(self) -> int:
        """Return M."""
        return len(self.fused)

    @property
    def point_counts(self) -> Int:
        """(M,) number of points of each vehicle."""
        return np.bincount(self.owners[self.owners >= 0], minlength=len(self))
