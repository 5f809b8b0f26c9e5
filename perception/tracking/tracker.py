"""Interface of the trackers of moving objects, and the base of their tables of tracks."""

from dataclasses import dataclass
from typing import Annotated, Protocol

import numpy as np

from perception.geometry import se3
from perception.geometry.boxes import transform_boxes
from perception.geometry.footprints import Footprints
from perception.tracking.kalman import Gaussians
from perception.tracking.visible_sides import from_world
from perception.types import Boxes3D, Float64, Tracks


class MultiObjectTracker(Protocol):
    """Tracks all moving objects of a drive, scan after scan."""

    def update(
        self,
        stamp_s: float,
        world_SE3_velo: Float64,
        moving: Footprints,
        static: Footprints,
        covariance: Float64 | None = None,
    ) -> Tracks:
        """Update the tracks by the clusters of one scan, and return the reported ones.

        Args:
            stamp_s: Time of the scan; a scan that is not later than the last one changes nothing.
            world_SE3_velo: (4, 4) pose of the scan.
            moving: Moving clusters in the LiDAR frame of the scan; only these begin tracks.
            static: Static clusters; they may continue the track of an object that has stopped.
            covariance: (6, 6) covariance of the pose; objects are located as much worse. None where it is exact.
        """
        ...

    def clear(self) -> None:
        """Delete all tracks, as where poses before and after do not fit together; ids are not used again."""
        ...


@dataclass(frozen=True)
class GroundPlaneTracks(Gaussians):
    """T tracks over the ground plane of the world.

    Attributes:
        mean: (T, 4) x and y of the box's centre, and its velocity.
        covariance: (T, 4, 4) covariance of these.
        yaw_rad: (T,) heading.
        low_world_m: (T,) z of the bottom.
    """

    mean: Annotated[Float64, 4]
    covariance: Annotated[Float64, 4, 4]
    yaw_rad: Float64
    low_world_m: Float64

    @property
    def speeds_m_s(self) -> Float64:
        """(T,) speed over the ground."""
        return np.asarray(np.hypot(self.mean[:, 2], self.mean[:, 3]))

    def boxes_velo(self, sizes_m: Float64, world_SE3_velo: Float64) -> Boxes3D:
        """Return the boxes of (T, 3) sizes in the LiDAR frame of a pose."""
        bottom_m = np.column_stack([self.mean[:, :2], self.low_world_m])
        boxes_world = Boxes3D(bottom_m, sizes_m, self.yaw_rad)
        boxes = transform_boxes(se3.inverse(world_SE3_velo), boxes_world)
        return Boxes3D(boxes.bottom_m, boxes.size_m, se3.wrap(boxes.yaw_rad))

    def velocities_velo(self, world_SE3_velo: Float64) -> Float64:
        """Return the (T, 2) velocities over the ground along x and y of the LiDAR frame of a pose."""
        return from_world(self.mean[:, 2:], np.full(len(self), _turn_rad(world_SE3_velo)))


def covariances_velo(covariances: Float64, world_SE3_velo: Float64) -> Float64:
    """Turn (T, 4, 4) covariances of x, y and velocity from the world into the LiDAR frame of a pose."""
    turn_rad = _turn_rad(world_SE3_velo)
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    turn = np.kron(np.eye(2), [[cos, sin], [-sin, cos]])
    return np.asarray(turn @ covariances @ turn.T)


def _turn_rad(world_SE3_velo: Float64) -> float:
    return float(np.arctan2(world_SE3_velo[1, 0], world_SE3_velo[0, 0]))
