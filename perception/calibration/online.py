"""The calibration while driving: by the edges of the last two seconds, and by the motion of their images.

Edges tell yaw and shifts best, motion pitch, roll and height. Edges alone serve a vehicle that stands.
"""

from perception.calibration.offset import OffsetEstimate
from perception.calibration.online_edges import OnlineEdges
from perception.calibration.online_motion import OnlineMotion
from perception.sensor import LidarModel
from perception.types import Float64, Frame


class OnlineCalibration:
    """Estimates how far the calibration is off."""

    def __init__(self, sensor: LidarModel) -> None:
        """Begin a drive.

        Args:
            sensor: LiDAR model of the scans.
        """
        self._edges, self._motion = OnlineEdges(sensor), OnlineMotion(sensor)
        self._by_edges: OffsetEstimate | None = None

    def update(self, frame: Frame, world_SE3_velo: Float64) -> OffsetEstimate | None:
        """Take in a frame; return the estimate where there is a new one.

        Args:
            frame: Frame as it came from the sensors; one without image or calibration tells nothing.
            world_SE3_velo: (4, 4) pose of the LiDAR.
        """
        # Of a frame that has aligned edges, motion is left for the next one.
        waiting, self._by_edges = self._by_edges, self._edges.update(frame, world_SE3_velo)
        self._motion.update(frame, world_SE3_velo)
        # At night the headlights' edge comes along with the vehicle, and looks like a street that stands still.
        uses_motion = not (self._motion.is_still or self._edges.is_night)
        if waiting is not None:
            return self._motion.refined(waiting) if uses_motion else waiting
        if not uses_motion:
            waiting, self._by_edges = self._by_edges, None
        return waiting
