"""Monitor of the INS: poses that are absent, frozen, jump, or drift away from the registration of scans.

The INS is compared with what the vehicle did by its scans: over one step by the velocity so far, over a second by the
registered poses. How well both usually agree is learned over the drive. The longer the step, the more the velocity
may change in it.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.geometry.se3 import inverse, rotation_angle_rad
from perception.types import INS, Float64, Frame, HealthFinding, HealthLevel

# Time over which drift adds up, the shortest that tells it, and the fewest poses in it.
_WINDOW_S, _MIN_WINDOW_S, _MIN_POSES = 1.05, 0.55, 3
_MAX_POSES = 64
_MAX_GAP_S = 1.1  # between two frames that are compared
# What a vehicle changes its velocity by, in m/s2 and rad/s2.
_MANOEUVRE_M_S2, _MANOEUVRE_RAD_S2 = 5.0, 1.0
_NEWEST = 0.1
_MIN_FROZEN_M = 0.15  # the way by the scans since poses are equal to the last digit
# Error of one step against the velocity so far, which braking and noise explain: 10 m/s2 make 0.1 m.
_MAX_STEP_M, _MAX_STEP_RAD = 0.6, np.radians(2.5)
# Error over the window; on KITTI the INS is off by up to 0.23 m in a second, registration now and then by 0.74 m.
_MAX_DRIFT_M, _MAX_DRIFT_RAD = 0.8, np.radians(2.0)
_MAX_RATIO = 4.0  # to the usual error


@dataclass(frozen=True)
class _Moment:
    stamp_s: float
    ins: Float64 | None
    registered: Float64


@dataclass
class _UsualError:
    """Error in metres and rad that is usual, and the limit beyond which it is none."""

    limit_m: float
    limit_rad: float
    usual_m: float = 0.0
    usual_rad: float = 0.0

    def exceeds(self, error_m: float, error_rad: float, gap_s: float = 0.0) -> bool:
        """Return whether an error is beyond the limit; learn it where it is not.

        Args:
            error_m: Error of the position in metres.
            error_rad: Error of the rotation in rad.
            gap_s: Time over which the velocity that it is measured by may have changed.
        """
        limit_m = self.limit_m + _MANOEUVRE_M_S2 * gap_s**2
        limit_rad = self.limit_rad + _MANOEUVRE_RAD_S2 * gap_s**2
        if error_m > max(limit_m, _MAX_RATIO * self.usual_m):
            return True
        if error_rad > max(limit_rad, _MAX_RATIO * self.usual_rad):
            return True
        self.usual_m += _NEWEST * (error_m - self.usual_m)
        self.usual_rad += _NEWEST * (error_rad - self.usual_rad)
        return False


class InsMonitor:
    """Compares poses of the INS with registered ones: `update` before registration, `register` after it."""

    def __init__(self) -> None:
        self._past: deque[_Moment] = deque(maxlen=_MAX_POSES)
        self._has_seen = self._has_jumped = False
        self._frozen_from: _Moment | None = None
        self._step = _UsualError(_MAX_STEP_M, _MAX_STEP_RAD)
        self._drift = _UsualError(_MAX_DRIFT_M, _MAX_DRIFT_RAD)

    def update(self, frame: Frame) -> Sequence[HealthFinding]:
        """Return the findings of the pose of a frame; none of a drive without INS."""
        pose = frame.world_SE3_velo
        if pose is None:
            reason = "the frame has no pose, those before it had one"
            return [_error("INS absent", reason)] if self._has_seen else []
        self._has_seen = True
        frozen, jump = self._frozen(pose), self._jumping(frame.stamp_s, pose)
        self._has_jumped = frozen is None and jump is not None
        found = frozen or jump or self._drifting()
        return [] if found is None else [found]

    def register(self, frame: Frame, world_SE3_velo: Float64, *, is_trusted: bool) -> None:
        """Remember the pose that the scan was given.

        Args:
            frame: Frame as it came from the sensors.
            world_SE3_velo: (4, 4) refined pose.
            is_trusted: Whether it follows from the one before, by a scan without fault.
        """
        if not is_trusted:
            self._past.clear()
            self._frozen_from = None
        # No step is measured from a pose that has jumped.
        pose = None if self._has_jumped else frame.world_SE3_velo
        self._past.append(_Moment(frame.stamp_s, pose, world_SE3_velo))

    def _frozen(self, pose: Float64) -> HealthFinding | None:
        last = self._past[-1] if self._past else None
        if last is None or last.ins is None or not np.array_equal(pose, last.ins):
            self._frozen_from = None
            return None
        self._frozen_from = self._frozen_from or last
        moved_m = _length_m(_motion(self._frozen_from.registered, last.registered))
        # The step of this frame is not known yet; by the one before it is likely.
        if len(self._past) > 1:
            moved_m += _length_m(_motion(self._past[-2].registered, last.registered))
        if moved_m < _MIN_FROZEN_M:
            return None
        reason = (
            f"the pose is equal to the last digit, while the scans have moved by {moved_m:.2f} m"
        )
        return _error("INS frozen", reason)

    def _jumping(self, stamp_s: float, pose: Float64) -> HealthFinding | None:
        if len(self._past) < 3:
            return None
        before, last = self._past[-2], self._past[-1]
        gap_s, last_gap_s = stamp_s - last.stamp_s, last.stamp_s - before.stamp_s
        if last.ins is None or not (0 < gap_s < _MAX_GAP_S and 0 < last_gap_s < _MAX_GAP_S):
            return None
        share = gap_s / last_gap_s
        expected, found = _motion(before.registered, last.registered), _motion(last.ins, pose)
        off_m = float(np.linalg.norm(found[:3, 3] - share * expected[:3, 3]))
        off_rad = rotation_angle_rad(inverse(expected) @ found) if 0.5 < share < 2 else 0.0
        if not self._step.exceeds(off_m, off_rad, gap_s):
            return None
        reason = f"a step {off_m:.2f} m and {np.degrees(off_rad):.1f} degrees beside the motion by the scans"
        return _error("INS jumping", reason)

    def _drifting(self) -> HealthFinding | None:
        """Compare the way of the last second, up to the frame before: this one is not registered yet."""
        if len(self._past) < _MIN_POSES:
            return None
        last = self._past[-1]
        recent = [one for one in self._past if last.stamp_s - one.stamp_s <= _WINDOW_S]
        first = recent[0]
        if len(recent) < _MIN_POSES or last.stamp_s - first.stamp_s < _MIN_WINDOW_S:
            return None
        if last.ins is None or first.ins is None:
            return None
        by_ins = _motion(first.ins, last.ins)
        by_scans = _motion(first.registered, last.registered)
        off_m = float(np.linalg.norm(by_ins[:3, 3] - by_scans[:3, 3]))
        off_rad = rotation_angle_rad(inverse(by_scans) @ by_ins)
        if not self._drift.exceeds(off_m, off_rad):
            return None
        reason = (
            f"{off_m:.2f} m and {np.degrees(off_rad):.1f} degrees beside the registered scans within "
            f"{last.stamp_s - first.stamp_s:.1f} s"
        )
        return _error("INS drifting", reason)


def _error(fault: str, reason: str) -> HealthFinding:
    return HealthFinding(INS, HealthLevel.ERROR, fault, reason)


def _motion(before: Float64, after: Float64) -> Float64:
    return inverse(before) @ after


def _length_m(motion: Float64) -> float:
    return float(np.linalg.norm(motion[:3, 3]))
