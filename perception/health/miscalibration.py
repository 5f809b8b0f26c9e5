"""Monitor of the calibration of LiDAR and camera: where edges and motion of both have not fitted for two seconds."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from perception.calibration.offset import OffsetEstimate
from perception.calibration.online import OnlineCalibration
from perception.geometry.se3 import from_motion_vector
from perception.sensor import LidarModel
from perception.types import CALIBRATION, Float64, Frame, HealthFinding, HealthLevel

FAULT = "calibration off"
# Standard deviations of an estimate up to which a calibration is taken for true. What is off ahead is not judged: it is
# the time between scan and image, too.
_LIMITS = np.array([3.5] * 5 + [np.inf])
# A change during a drive: what the scene adds to each estimate has shown in those before, whose deviation counts as well.
_CHANGE_LIMITS = np.array([3.0] * 5 + [np.inf])
_USUAL_LIMIT, _MIN_ESTIMATES = 4.0, 3
# By how much edges and motion together must fit better than without the offset, a logarithm of likelihoods: edges that
# fit beside their own are contradicted by motion, and what moves beside the vehicle by edges.
_MIN_GAIN = 9.0
# One estimate warns; the next one, which agrees, makes an error, and what the pipeline does depends on it.
# An error is over where the estimate is below such a share of what makes one.
_END_SHARE = 0.7


class MiscalibrationMonitor:
    """Compares edges and motion of scans and images over two seconds."""

    def __init__(self, sensor: LidarModel) -> None:
        self._online = OnlineCalibration(sensor)
        self._usual = _UsualOffset()
        self._found: OffsetEstimate | None = None
        self._is_confirmed = False

    @property
    def correction(self) -> Float64 | None:
        """(4, 4) change of the calibration during an error: its cam_SE3_velo is multiplied by it from the left."""
        if self._found is None or not self._is_confirmed:
            return None
        return from_motion_vector(self._found.offset)

    def update(self, frame: Frame, world_SE3_velo: Float64) -> Sequence[HealthFinding]:
        """Return a warning or an error while the calibration is off.

        Args:
            frame: Frame as it came from the sensors.
            world_SE3_velo: (4, 4) pose of the LiDAR.
        """
        estimate = self._online.update(frame, world_SE3_velo)
        if estimate is not None and estimate.is_determined:
            self._take_in(estimate)
        if self._found is None:
            return ()
        level = HealthLevel.ERROR if self._is_confirmed else HealthLevel.WARN
        return (HealthFinding(CALIBRATION, level, FAULT, _sentence(self._found)),)

    def _take_in(self, estimate: OffsetEstimate) -> None:
        """Find out whether the calibration is off by a new estimate."""
        share = float((np.abs(estimate.offset) / (_LIMITS * estimate.deviations)).max())
        share = max(share, self._usual.share(estimate))
        is_off = share > (1.0 if self._found is None else _END_SHARE)
        if is_off and self._found is None and self._online.gain(estimate.offset) < _MIN_GAIN:
            return
        self._is_confirmed = is_off and self._found is not None
        self._found = estimate if is_off else None
        if not is_off:
            self._usual.add(estimate)


class _UsualOffset:
    """What estimates without a fault have been in this drive: the calibration's own error, and what scenes add."""

    def __init__(self) -> None:
        self._count, self._weights = 0, np.zeros(6)
        self._mean, self._squares = np.zeros(6), np.zeros(6)
        self._newest: OffsetEstimate | None = None

    def add(self, newest: OffsetEstimate) -> None:
        """Learn from the estimate before the newest one, as the newest may be half of a change."""
        learned, self._newest = self._newest, newest
        if learned is None:
            return
        weights = 1 / np.square(learned.deviations)
        self._count, self._weights = self._count + 1, self._weights + weights
        before = learned.offset - self._mean
        self._mean = self._mean + weights / self._weights * before
        self._squares = self._squares + weights * before * (learned.offset - self._mean)

    def share(self, estimate: OffsetEstimate) -> float:
        """Return the change as a share of what counts, the largest of the six; none before enough is known."""
        if self._count < _MIN_ESTIMATES:
            return 0.0
        # Of one estimate, not of their mean: they share what the scene adds.
        variances = self._count / self._weights
        usual = np.sqrt(self._squares / self._weights * self._count / (self._count - 1))
        # Where little was known before, what is known now is no change.
        deviations = np.maximum(estimate.deviations, np.sqrt(variances))
        limits = np.maximum(_CHANGE_LIMITS * deviations, _USUAL_LIMIT * usual)
        return float((np.abs(estimate.offset - self._mean) / limits).max())


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
        f"edges and motion of scan and image fit after a turn by {pitch:+.1f}, {yaw:+.1f}, {roll:+.1f} degrees "
        f"(pitch, yaw, roll) and a shift by {right:+.0f}, {down:+.0f} cm (right, down), expected none; "
        "recalibrate with: trifuse calibrate DRIVE"
    )
