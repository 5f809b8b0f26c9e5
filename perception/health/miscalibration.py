"""Monitor of the calibration of LiDAR and camera: where their edges have not fitted for two seconds."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from perception.calibration.edge_alignment import offset_SE3
from perception.calibration.online import OffsetEstimate, OnlineCalibration
from perception.sensor import LidarModel
from perception.types import CALIBRATION, Float64, Frame, HealthFinding, HealthLevel

FAULT = "calibration off"
# Clean drives stay below (docs/method/calibration.md). Scenes of few or faint edges widen the limits.
_MAX_ROTATION_RAD = np.radians((0.4, 0.3, 0.55))  # pitch, yaw, roll
_MAX_SHARE_OF_BEAM_STEP = 0.6
_MAX_TRANSLATION_M = 0.08
# Where edges fit, they score 0.40 to 0.50; trees and rails, whose edges the image shows elsewhere, 0.34 to 0.38.
_MIN_SCORE = 0.39
# A change during a drive: what the scene adds to each estimate has shown in those before. Limits are four times their
# deviation, at least these: pitch, yaw, roll in rad; right, down, ahead in m.
_MIN_CHANGE = np.array([*np.radians((0.25, 0.2, 0.4)), 0.045, 0.055, np.inf])
_USUAL_DEVIATIONS, _MIN_ESTIMATES = 4.0, 3
# One estimate warns; the next one, which agrees, makes an error, and what the pipeline does depends on it.
# An error is over where the estimate is below such a share of what makes one.
_END_SHARE = 0.7


class MiscalibrationMonitor:
    """Compares edges of scans and images over two seconds."""

    def __init__(self, sensor: LidarModel) -> None:
        """Begin a drive.

        Args:
            sensor: LiDAR model of the scans.
        """
        self._online = OnlineCalibration(sensor)
        beam_rad = _MAX_SHARE_OF_BEAM_STEP * sensor.elevation_step_rad
        pitch, yaw, roll = _MAX_ROTATION_RAD
        limits_rad = (max(pitch, beam_rad), yaw, max(roll, beam_rad))
        self._limits = np.array([*limits_rad, *[_MAX_TRANSLATION_M] * 2, np.inf])
        self._usual = _UsualOffset(np.maximum(_MIN_CHANGE, [beam_rad, 0, beam_rad, 0, 0, 0]))
        self._found: OffsetEstimate | None = None
        self._is_confirmed = False

    @property
    def correction(self) -> Float64 | None:
        """(4, 4) change of the calibration during an error: its cam_SE3_velo is multiplied by it from the left."""
        if self._found is None or not self._is_confirmed:
            return None
        return offset_SE3(self._found.offset)

    def update(self, frame: Frame, world_SE3_velo: Float64) -> Sequence[HealthFinding]:
        """Return a warning or an error while the calibration is off.

        Args:
            frame: Frame as it came from the sensors.
            world_SE3_velo: (4, 4) pose of the LiDAR.
        """
        estimate = self._online.update(frame, world_SE3_velo)
        if estimate is not None and estimate.is_determined and estimate.score >= _MIN_SCORE:
            share = float((np.abs(estimate.offset) / self._limits).max())
            share = max(share, self._usual.share(estimate.offset)) / estimate.uncertainty
            is_off = share > (1.0 if self._found is None else _END_SHARE)
            self._is_confirmed = is_off and self._found is not None
            self._found = estimate if is_off else None
            if not is_off:
                self._usual.add(estimate.offset)
        if self._found is None:
            return ()
        level = HealthLevel.ERROR if self._is_confirmed else HealthLevel.WARN
        return (HealthFinding(CALIBRATION, level, FAULT, _sentence(self._found)),)


class _UsualOffset:
    """What estimates without a fault have been in this drive: the calibration's own error, and what scenes add."""

    def __init__(self, min_change: Float64) -> None:
        """Begin a drive.

        Args:
            min_change: (6,) least change that counts.
        """
        self._min_change = min_change
        self._count, self._mean, self._squares = 0, np.zeros(6), np.zeros(6)
        self._newest: Float64 | None = None

    def add(self, newest: Float64) -> None:
        """Learn from the estimate before the newest one, as the newest may be half of a change."""
        offset, self._newest = self._newest, newest
        if offset is None:
            return
        self._count += 1
        before = offset - self._mean
        self._mean = self._mean + before / self._count
        self._squares = self._squares + before * (offset - self._mean)

    def share(self, offset: Float64) -> float:
        """Return the change as a share of what counts, the largest of the six; none before enough is known."""
        if self._count < _MIN_ESTIMATES:
            return 0.0
        deviation = np.sqrt(self._squares / (self._count - 1))
        limits = np.maximum(self._min_change, _USUAL_DEVIATIONS * deviation)
        return float((np.abs(offset - self._mean) / limits).max())


def corrected(frame: Frame, correction: Float64 | None) -> Frame:
    """Return a frame with the calibration of its camera changed, or as it is without a correction."""
    if correction is None or frame.calibration is None:
        return frame
    cam_SE3_velo = correction @ frame.calibration.cam_SE3_velo
    return replace(frame, calibration=replace(frame.calibration, cam_SE3_velo=cam_SE3_velo))


def _sentence(found: OffsetEstimate) -> str:
    pitch, yaw, roll = np.degrees(found.offset[:3])
    right, down, _ = 100 * found.offset[3:]
    return (
        f"edges of scan and image fit after a turn by {pitch:+.1f}, {yaw:+.1f}, {roll:+.1f} degrees "
        f"(pitch, yaw, roll) and a shift by {right:+.0f}, {down:+.0f} cm (right, down), expected none; "
        "recalibrate with: trifuse calibrate DRIVE"
    )
