"""Registered poses of frames, one after another, without the other stages of the pipeline."""

from perception.geometry.grids import EgoVehicle
from perception.localization.odometry import LidarOdometry
from perception.types import Float64, Frame


class FrameRegistration:
    """Registers the frames of a drive, one after another, as the pipeline does."""

    def __init__(self) -> None:
        self._odometry, self._ego = LidarOdometry(), EgoVehicle()

    def update(self, frame: Frame) -> Float64:
        """Return the (4, 4) registered pose of the next frame."""
        points_velo = self._ego.crop(frame.points_velo).points_velo
        found = self._odometry.update(
            points_velo, frame.stamp_s, frame.world_SE3_velo, frame.source
        )
        return found.world_SE3_velo
