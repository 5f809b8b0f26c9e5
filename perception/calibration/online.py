"""The calibration while driving: by the edges of the last two seconds, and by the motion of their images.

Edges tell yaw and shifts best, motion pitch, roll and height. Edges alone serve a vehicle that stands.
"""

from perception.calibration.offset import OffsetEstimate
from perception.calibration.online_edges import OnlineEdges
from perception.calibration.online_motion import OnlineMotion
from perception.sensor import LidarModel
from perception.types import Float64, Frame

# What a score of edges is worth as a logarithm of likelihoods: an offset by half a degree gains 0.03 to 0.1 of score.
_SCORE_WEIGHT = 150.0


class OnlineCalibration:
    """Estimates how far the calibration is off."""

    def __init__(self, sensor: LidarModel) -> None:
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
        if waiting is not None:
            return self._motion.refined(waiting) if self._uses_motion else waiting
        if not self._uses_motion:
            waiting, self._by_edges = self._by_edges, None
        return waiting

    @property
    def _uses_motion(self) -> bool:
        # At night the headlights' edge comes along with the vehicle, and looks like a street that stands still.
        return not (self._motion.is_still or self._edges.is_night)

    def gain(self, offset: Float64) -> float:
        """Return by how much edges and motion fit better with a (6,) offset than with none, a logarithm of likelihoods."""
        by_motion = self._motion.gain(offset) if self._uses_motion else 0.0
        return _SCORE_WEIGHT * self._edges.gain(offset) + by_motion
