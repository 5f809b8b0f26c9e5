"""Interface of the trackers of moving objects, and the base of their tables of tracks."""

from dataclasses import dataclass
from typing import Annotated, Protocol

import numpy as np

from perception.geometry.footprints import Footprints
from perception.tracking.kalman import Gaussians
from perception.types import ArrayTable, Float64, Tracks


class MultiObjectTracker(Protocol):
    """Tracks all moving objects of a drive, scan after scan."""

    def update(
        self, stamp_s: float, world_SE3_velo: Float64, moving: Footprints, static: Footprints
    ) -> Tracks:
        """Update the tracks by the clusters of one scan, and return the reported ones.

        Args:
            stamp_s: Time of the scan; a scan that is not later than the last one changes nothing.
            world_SE3_velo: (4, 4) pose of the scan.
            moving: Moving clusters in the LiDAR frame of the scan; only these begin tracks.
            static: Static clusters; they may continue the track of an object that has stopped.
        """
        ...

    def clear(self) -> None:
        """Delete all tracks, as where poses before and after do not fit together; ids are not used again."""
        ...


@dataclass(frozen=True)
class GroundPlaneTracks(ArrayTable):
    """T tracks over the ground plane of the world.

    Attributes:
        mean: (T, 4) x and y of the box's centre, and its velocity.
        covariance: (T, 4, 4) covariance of these.
    """

    mean: Annotated[Float64, 4]
    covariance: Annotated[Float64, 4, 4]

    @property
    def states(self) -> Gaussians:
        """States of the Kalman filters."""
        return Gaussians(self.mean, self.covariance)

    @property
    def speeds_m_s(self) -> Float64:
        """(T,) speed over the ground."""
        return np.asarray(np.hypot(self.mean[:, 2], self.mean[:, 3]))
