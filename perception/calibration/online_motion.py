"""The motion of images while driving: corners of every third frame, tracked into one soon after.

frame    1        2       4        5       7        8       ...
corners  tracks  corners  tracks  corners  tracks
"""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from perception.calibration.grey_image import GreyImage
from perception.calibration.image_edges import FOCAL_PX
from perception.calibration.motion_alignment import align_motion
from perception.calibration.offset import UNKNOWN, OffsetEstimate, offset_of, offset_SE3
from perception.calibration.surface_corners import (
    CornerTracks,
    ScanView,
    SurfaceCorners,
    SweepVelocity,
)
from perception.geometry.se3 import inverse
from perception.sensor import LidarModel
from perception.types import Float64, Frame

_EVERY, _FIRST, _FRAMES = 3, 1, 6
_MIN_FRAMES = 4  # without edges
# Corners have to come nearer to tell anything: a slow vehicle waits, up to the next corners.
_USUAL_TRAVEL_M, _MIN_TRAVEL_M = 0.4, 0.15
_MIN_CORNERS = 15  # of a frame
_MAX_GAP_S, _MAX_AGE_S = 1.0, 4.0
# What errors that are alike in all frames leave.
_MIN_DEVIATIONS = np.array([*np.radians([0.06, 0.07, 0.09]), 0.010, 0.012, 0.015])
# Planes are associated again where the calibration is found to be so far from the one of their association.
_MAX_ASSOCIATION_CHANGE = np.array([*np.radians([0.15] * 3), *[0.03] * 3])
_MAX_ASSOCIATIONS = 3


@dataclass(frozen=True)
class _Observation:
    """Corners that wait for a later image, their image, the pose of the LiDAR, and its motion during the sweep."""

    image: GreyImage
    corners: SurfaceCorners
    world_SE3_velo: Float64
    sweep: SweepVelocity


class OnlineMotion:
    """Collects what the images of a moving camera tell of the calibration."""

    def __init__(self, sensor: LidarModel) -> None:
        """Begin a drive.

        Args:
            sensor: LiDAR model of the scans.
        """
        self._period_s = 1 / sensor.rate_hz
        self._tracks: deque[tuple[float, CornerTracks]] = deque(maxlen=_FRAMES)
        self._observation: _Observation | None = None
        self._pose: tuple[float, Float64] | None = None
        self._count = 0
        self._offset = np.zeros(6)  # as far as it is known

    @property
    def is_still(self) -> bool:
        """Whether nothing has been tracked of late, as by a vehicle that stands."""
        return not self._tracks

    def update(self, frame: Frame, world_SE3_velo: Float64) -> None:
        """Take in a frame.

        Args:
            frame: Frame as it came from the sensors; one without image or calibration tells nothing.
            world_SE3_velo: (4, 4) pose of the LiDAR.
        """
        before, self._pose = self._pose, (frame.stamp_s, world_SE3_velo)
        self._count += 1
        is_turn = self._count % _EVERY == _FIRST
        while self._tracks and not 0 <= frame.stamp_s - self._tracks[0][0] <= _MAX_AGE_S:
            self._tracks.popleft()
        if frame.image is None or frame.calibration is None:
            self._observation = None
            return
        self._track(frame, world_SE3_velo, is_last=is_turn)
        if is_turn and before is not None:
            self._observe(frame, world_SE3_velo, *before)

    def _observe(
        self, frame: Frame, world_SE3_velo: Float64, before_s: float, world_SE3_before: Float64
    ) -> None:
        """Find the corners of a frame, where the motion since the frame before is known."""
        gap_s = frame.stamp_s - before_s
        if not 0 < gap_s <= _MAX_GAP_S:
            return
        before_SE3_velo = inverse(world_SE3_before) @ world_SE3_velo
        image = _image(frame)
        view = ScanView.of(frame, image)
        corners = SurfaceCorners.find(image, view, offset_SE3(self._offset))
        sweep = SweepVelocity.between(before_SE3_velo, gap_s, self._period_s)
        self._observation = _Observation(image, corners, world_SE3_velo, sweep)

    def _track(self, frame: Frame, world_SE3_velo: Float64, *, is_last: bool) -> None:
        """Track the corners that wait into a frame, where they have come near enough."""
        observed = self._observation
        if observed is None:
            return
        later_SE3_velo = inverse(world_SE3_velo) @ observed.world_SE3_velo
        travelled_m = float(np.linalg.norm(later_SE3_velo[:3, 3]))
        if travelled_m < (_MIN_TRAVEL_M if is_last else _USUAL_TRAVEL_M):
            return
        self._observation, later = None, _image(frame)
        if later.size_px != observed.image.size_px:
            return
        tracks = CornerTracks.track(
            observed.corners, observed.image, later, later_SE3_velo, observed.sweep
        )
        if len(tracks) >= _MIN_CORNERS:
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
        found = known
        for _ in range(_MAX_ASSOCIATIONS):
            if any(_is_far(one, found.offset) for one in tracks):
                changed = offset_SE3(found.offset)
                tracks = [one.reassociated(changed) for one in tracks]
            elif found is not known:
                break
            found = align_motion(tracks, found.offset, known)
        self._offset = found.offset if _is_large(found.offset) else np.zeros(6)
        return replace(found, deviations=np.maximum(found.deviations, _MIN_DEVIATIONS))


def _image(frame: Frame) -> GreyImage:
    assert frame.image is not None and frame.calibration is not None
    return GreyImage.of(frame.image, frame.calibration, FOCAL_PX)


def _is_far(tracks: CornerTracks, offset: Float64) -> bool:
    associated = offset_of(tracks.corners.offset_SE3_cam)
    return _is_large(associated - offset)


def _is_large(change: Float64) -> bool:
    return bool((np.abs(change) > _MAX_ASSOCIATION_CHANGE).any())
