"""Odometry drawn to the INS: poses as smooth as the scans say, on the earth as the INS says.

Odometry drifts, an INS wanders around the truth. How far both come apart, squared, over a time t, is

    S(t) = 2 R + Q t

What has come back after some seconds is R, the variance of the INS; what still grows is Q, that of the odometry a second.
Both are learned over the drive from S at two times, in each direction of the LiDAR frame, and a Kalman filter weighs them.
An error of the INS lasts for some scans, which together tell as much as one that is independent. An INS whose height
never changes states none: it is that of the scans.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.geometry.se3 import cross_matrix, from_motion_vector, inverse, motion_vector
from perception.types import Float64, Frame

# The two times in seconds, how far they may be off where scans are far apart; an error of the INS lasts for the later one.
_SOON_S, _LATER_S, _TOLERANCE_S = 1.0, 3.0, 0.35
# Standard deviations before any is learned, in rad and m: of the INS, and of the odometry in a second; for how many seconds
# they count, and over how many the averages reach.
_INS, _DRIFT = (np.radians(0.1), 0.05), (np.radians(0.2), 0.2)
_PRIOR_S, _MEMORY_S = 4.0, 60.0
# No INS and no odometry is better than this.
_LEAST_INS, _LEAST_DRIFT = (np.radians(0.005), 0.005), (np.radians(0.01), 0.005)
# Height of a point of the vehicle that never changes, though it moves: metres, way and number of poses that tell it.
_FLAT_M, _MIN_WAY_M, _MIN_POSES, _MAX_POSES = 1e-5, 1.0, 8, 128


@dataclass(frozen=True)
class _Moment:
    stamp_s: float
    odom_SE3_velo: Float64
    ins: Float64 | None


class InsFusion:
    """Draws the odometry of a drive to the INS.

    Attributes:
        world_SE3_odom: (4, 4) correction from the world of the odometry to that of the INS.
    """

    def __init__(self) -> None:
        self.world_SE3_odom = np.eye(4)
        ins, drift = np.repeat(_INS, 3) ** 2, np.repeat(_DRIFT, 3) ** 2
        # Seconds that the averages have seen, and S at the two times.
        self._seen_s = _PRIOR_S
        self._apart = np.array([2 * ins + drift * _SOON_S, 2 * ins + drift * _LATER_S])
        self._past: deque[_Moment] = deque(maxlen=_MAX_POSES)
        self._rotation = np.eye(3)
        self._filtered: Float64 | None = None  # (6, 6) covariance in the LiDAR frame
        self._is_flat = False

    def update(self, frame: Frame, odom_SE3_velo: Float64, *, is_continuous: bool) -> None:
        """Take the poses of the next scan.

        Args:
            frame: Frame of the scan; its INS is one that can be trusted.
            odom_SE3_velo: (4, 4) pose by odometry.
            is_continuous: Whether the step of the odometry since the scan before is one that scans gave.
        """
        if not is_continuous:
            self._past.clear()
        last = self._past[-1] if self._past else None
        now = _Moment(frame.stamp_s, odom_SE3_velo, frame.world_SE3_velo)
        self._past.append(now)
        if last is not None and self._filtered is not None:
            self._learn(last, now)
            self._filtered = self._filter(last, now, self._filtered)
        elif now.ins is not None:
            self.world_SE3_odom = now.ins @ inverse(odom_SE3_velo)
            self._filtered = np.diag(self._ins_and_drift()[0])
        self._rotation = (self.world_SE3_odom @ odom_SE3_velo)[:3, :3]

    @property
    def covariance(self) -> Float64 | None:
        """(6, 6) covariance of the last pose, position in m and rotation vector in rad along the axes of the world.

        None before there was an INS.
        """
        if self._filtered is None:
            return None
        # What both come apart by in some seconds may be the error of either.
        covariance = self._filtered + np.diag(self._apart[1] / 2)
        rotation = np.kron(np.eye(2), self._rotation)
        return np.asarray(rotation @ np.roll(covariance, 3, axis=(0, 1)) @ rotation.T)

    def _learn(self, last: _Moment, now: _Moment) -> None:
        """Average how far INS and odometry come apart."""
        if now.ins is None:
            return
        self._is_flat = is_flat([one.ins for one in self._past if one.ins is not None])
        ages_s = now.stamp_s - np.array([one.stamp_s for one in self._past])
        if ages_s[0] < _LATER_S - _TOLERANCE_S:
            return
        apart = []
        for wanted_s in (_SOON_S, _LATER_S):
            row = int(np.argmin(np.abs(ages_s - wanted_s)))
            found = _disagreement(self._past[row], now)
            if found is None or abs(ages_s[row] - wanted_s) > _TOLERANCE_S:
                return
            apart.append(found**2)
        gap_s = now.stamp_s - last.stamp_s
        self._seen_s = min(self._seen_s + gap_s, _MEMORY_S)
        self._apart += (np.array(apart) - self._apart) * (gap_s / self._seen_s)

    def _filter(self, last: _Moment, now: _Moment, covariance: Float64) -> Float64:
        """Predict the pose by the step of the odometry, correct it by the INS, and return its covariance."""
        gap_s = now.stamp_s - last.stamp_s
        of_ins, drift = self._ins_and_drift()
        of_ins *= max(_LATER_S / gap_s, 1.0)
        back = _adjoint(inverse(now.odom_SE3_velo) @ last.odom_SE3_velo)
        covariance = back @ covariance @ back.T + np.diag(drift * gap_s)
        if now.ins is None:
            return covariance
        predicted = self.world_SE3_odom @ now.odom_SE3_velo
        stated = np.eye(6)
        if self._is_flat:
            up_velo = predicted[2, :3]
            stated[3:, 3:] -= np.outer(up_velo, up_velo)
        off = stated @ motion_vector(inverse(predicted) @ now.ins)
        gain = covariance @ stated @ np.linalg.inv(stated @ covariance @ stated + np.diag(of_ins))
        pose = predicted @ from_motion_vector(gain @ off)
        self.world_SE3_odom = pose @ inverse(now.odom_SE3_velo)
        return np.asarray((np.eye(6) - gain @ stated) @ covariance)

    def _ins_and_drift(self) -> tuple[Float64, Float64]:
        """Return the (6,) variances of the INS, and of the odometry in a second."""
        soon, later = self._apart
        drift = np.maximum((later - soon) / (_LATER_S - _SOON_S), 0.0)
        ins = np.maximum(soon - drift * _SOON_S, 0.0) / 2
        least_ins, least_drift = (np.repeat(one, 3) ** 2 for one in (_LEAST_INS, _LEAST_DRIFT))
        return ins + least_ins, drift + least_drift


def is_flat(poses: Sequence[Float64]) -> bool:
    """Return whether a point of a vehicle that moves keeps its height to the last digits, in (4, 4) poses of its LiDAR."""
    stacked = np.array(poses)
    if len(stacked) < _MIN_POSES:
        return False
    way_m = np.linalg.norm(np.diff(stacked[:, :3, 3], axis=0), axis=1).sum()
    if way_m < _MIN_WAY_M:
        return False
    # Height of the LiDAR: that of the point, and its own above it by the tilt.
    terms = np.column_stack([np.ones(len(stacked)), stacked[:, 2, :3]])
    parts = np.linalg.lstsq(terms, stacked[:, 2, 3], rcond=None)[0]
    return bool((np.abs(terms @ parts - stacked[:, 2, 3]) <= _FLAT_M).all())


def _disagreement(before: _Moment, after: _Moment) -> Float64 | None:
    """Return the (6,) motion by which the INS went otherwise than the odometry, None where it is not known."""
    if before.ins is None or after.ins is None:
        return None
    by_odometry = inverse(before.odom_SE3_velo) @ after.odom_SE3_velo
    return motion_vector(inverse(by_odometry) @ inverse(before.ins) @ after.ins)


def _adjoint(dst_SE3_src: Float64) -> Float64:
    """Return the (6, 6) matrix that moves a small motion, rotation vector and translation, to another frame."""
    rotation, zero = dst_SE3_src[:3, :3], np.zeros((3, 3))
    return np.block([[rotation, zero], [cross_matrix(dst_SE3_src[:3, 3]) @ rotation, rotation]])
