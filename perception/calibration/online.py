"""The calibration while driving: by the edges of the last two seconds, and by the motion of their images.

Edges tell yaw and shifts best, motion pitch, roll and height. Edges alone serve a vehicle that stands.
"""

from collections import deque
from dataclasses import replace

import numpy as np

from perception.calibration.motion_alignment import is_large, motion_gain, refine_by_motion
from perception.calibration.observed_corners import MIN_TRAVEL_M, USUAL_TRAVEL_M, ObservedCorners
from perception.calibration.offset import UNKNOWN, OffsetEstimate
from perception.calibration.online_edges import OnlineEdges
from perception.calibration.surface_corners import CornerTracks, SweepVelocity
from perception.geometry.se3 import from_motion_vector, inverse
from perception.sensor import LidarModel
from perception.types import Float64, Frame

_EVERY, _FIRST, _FRAMES = 6, 3, 4
_MIN_FRAMES = 3  # without edges
# Without edges it is less certain than its corners say, of yaw and shifts most: what moves beside the vehicle looks like these.
_ALONE = np.array([1.3, 2.5, 1.6, 2.5, 1.3, 2.5])
_MAX_GAP_S, _MAX_AGE_S = 1.0, 4.0
# What a score of edges is worth as a logarithm of likelihoods: an offset by half a degree gains 0.03 to 0.1 of score.
_SCORE_WEIGHT = 150.0


class OnlineMotion:
    """Collects what the images of a moving camera tell of the calibration."""

    def __init__(self, sensor: LidarModel) -> None:
        self._period_s = 1 / sensor.rate_hz
        self._tracks: deque[tuple[float, CornerTracks]] = deque(maxlen=_FRAMES)
        self._observed: ObservedCorners | None = None
        self._pose: tuple[float, Float64] | None = None
        self._count = 0
        self._offset = np.zeros(6)  # as far as it is known

    @property
    def is_still(self) -> bool:
        """Whether nothing has been tracked of late, as by a vehicle that stands."""
        return not self._tracks

    def update(self, frame: Frame, world_SE3_velo: Float64) -> None:
        """Take in a frame as of `OnlineCalibration`."""
        before, self._pose = self._pose, (frame.stamp_s, world_SE3_velo)
        self._count += 1
        is_turn = self._count % _EVERY == _FIRST
        while self._tracks and not 0 <= frame.stamp_s - self._tracks[0][0] <= _MAX_AGE_S:
            self._tracks.popleft()
        if frame.image is None or frame.calibration is None:
            self._observed = None
            return
        self._track(frame, world_SE3_velo, is_last=is_turn)
        if is_turn and before is not None:
            self._observe(frame, world_SE3_velo, *before)

    def _observe(
        self, frame: Frame, world_SE3_velo: Float64, before_s: float, world_SE3_before: Float64
    ) -> None:
        """Find the corners of a frame, where the motion since the frame before is known."""
        gap_s = frame.stamp_s - before_s
        if 0 < gap_s <= _MAX_GAP_S:
            before_SE3_velo = inverse(world_SE3_before) @ world_SE3_velo
            sweep = SweepVelocity.between(before_SE3_velo, gap_s, self._period_s)
            self._observed = ObservedCorners.of(
                frame, world_SE3_velo, sweep, from_motion_vector(self._offset)
            )

    def _track(self, frame: Frame, world_SE3_velo: Float64, *, is_last: bool) -> None:
        """Track the corners that wait into a frame, where they have come near enough."""
        if self._observed is None:
            return
        needed_m = MIN_TRAVEL_M if is_last else USUAL_TRAVEL_M
        if self._observed.travelled_m(world_SE3_velo) >= needed_m:
            tracks = self._observed.tracked(frame, world_SE3_velo)
            self._observed = None
            if tracks is not None:
                self._tracks.append((frame.stamp_s, tracks))

    def refined(self, by_edges: OffsetEstimate) -> OffsetEstimate:
        """Return an estimate with what the motion of the images tells beside it.

        Args:
            by_edges: Estimate by edges; one that does not count is replaced, where the vehicle has moved enough.
        """
        tracks = [one for _, one in self._tracks]
        if not tracks or (not by_edges.is_determined and len(tracks) < _MIN_FRAMES):
            return by_edges
        known = by_edges if by_edges.is_determined else OffsetEstimate(self._offset, UNKNOWN)
        refined = refine_by_motion(tracks, known, self._offset)
        found = refined.estimate
        self._offset = found.offset if is_large(found.offset) else np.zeros(6)
        # With their planes, which the next estimate need not look for again.
        stamps_s = [stamp_s for stamp_s, _ in self._tracks]
        self._tracks = deque(zip(stamps_s, refined.tracks, strict=True), maxlen=_FRAMES)
        if by_edges.is_determined:
            return found
        return replace(found, deviations=_ALONE * found.deviations)

    def gain(self, offset: Float64) -> float:
        """Return by how much the corners fit better with a (6,) offset than with none, a logarithm of likelihoods."""
        return motion_gain([one for _, one in self._tracks], offset) if self._tracks else 0.0


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
