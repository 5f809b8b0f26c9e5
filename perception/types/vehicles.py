"""What is detected, as objects on the road."""

from dataclasses import dataclass

import numpy as np

from perception.types.arrays import Float64, Int, require_shape
from perception.types.boxes import Boxes3D
from perception.types.detections import FusedDetections


@dataclass(frozen=True)
class Vehicles:
    """M detected vehicles as objects on the road, in the LiDAR frame of one scan of N points.

    Attributes:
        fused: (M) what the detectors saw.
        ids: (M,) track ids, those of `Tracks` where an object is followed by both; -1 before one is given.
        boxes: (M) 3D boxes on the ground; rows of NaN where the LiDAR says too little.
        distances_m: (M,) from the LiDAR to the nearest return, NaN without one.
        velocities_m_s: (M, 2) over the ground along x and y of the LiDAR frame, NaN before it is known.
        owners: (N,) for each point the vehicle that it belongs to, or -1.
    """

    fused: FusedDetections
    ids: Int
    boxes: Boxes3D
    distances_m: Float64
    velocities_m_s: Float64
    owners: Int

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
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
        """(M,) how many points of the scan belong to each."""
        return np.bincount(self.owners[self.owners >= 0], minlength=len(self))
