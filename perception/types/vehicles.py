"""Detected vehicles as objects on the road."""

from dataclasses import dataclass

import numpy as np

from perception.types.arrays import Float64, Int, require_shape
from perception.types.boxes import Boxes3D
from perception.types.detections import FusedDetections


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
