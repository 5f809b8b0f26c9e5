"""Odometry drawn to the INS: poses as smooth as the scans say, on the earth as the INS says.

Odometry drifts, an INS jitters. Where their steps d from scan to scan disagree, what comes back at the next scan is the
jitter of the INS, and what adds up is the drift of the odometry:

    E[d(k) d(k+1)] = -R        E[d(k)^2] = 2 R + Q

R is the variance of the position of the INS and Q that of a step of the odometry, both learned over the drive in each
direction of the LiDAR frame; a Kalman filter weighs them. An INS whose height never changes states none: it is that of
the scans. What wanders over some seconds neither tells from the other: by how far both come apart, the error of either
is bounded; all of it counts.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.geometry.se3 import cross_matrix, from_motion_vector, inverse, motion_vector
from perception.types import Float64, Frame

# Standard deviations before any is learned, in rad and m, and for how many steps they count: of a pose of the INS, of a step
# of odometry, and of what either wanders by in 5 s. The last steps are those over which the averages reach.
_INS, _STEP, _WANDER = (np.radians(0.05), 0.05), (np.radians(0.05), 0.02), (np.radians(0.1), 0.05)
_PRIOR_STEPS, _MEMORY_STEPS = 10, 200
_WANDER_S, _MIN_WANDER_S = 5.0, 0.95
# No INS is better than this.
_LEAST = (np.radians(0.005), 0.005)
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
        ins, step = np.repeat(_INS, 3) ** 2, np.repeat(_STEP, 3) ** 2
        # Number and averages of the squared disagreement of a step, and of its product with that of the step before.
        self._steps, self._square, self._product = _PRIOR_STEPS, 2 * ins + step, -ins
        self._disagreement: Float64 | None = None
        self._apart, self._square_apart = _PRIOR_STEPS, np.repeat(_WANDER, 3) ** 2
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
            self._disagreement = None
        last = self._past[-1] if self._past else None
        now = _Moment(frame.stamp_s, odom_SE3_velo, frame.world_SE3_velo)
        self._past.append(now)
        if last is not None and self._filtered is not None:
            self._learn(last, now)
            self._filtered = self._filter(last, now, self._filtered)
        elif now.ins is not None:
            self.world_SE3_odom = now.ins @ inverse(odom_SE3_velo)
            self._filtered = np.diag(self._variances()[0])
        self._rotation = (self.world_SE3_odom @ odom_SE3_velo)[:3, :3]

    @property
    def covariance(self) -> Float64 | None:
        """(6, 6) covariance of the last pose, position in m and rotation vector in rad along the axes of the world.

        None before there was an INS.
        """
        if self._filtered is None:
            return None
        covariance = self._filtered + np.diag(self._square_apart)
        rotation = np.kron(np.eye(2), self._rotation)
        return np.asarray(rotation @ np.roll(covariance, 3, axis=(0, 1)) @ rotation.T)

    def _learn(self, last: _Moment, now: _Moment) -> None:
        """Average how the steps of INS and odometry disagree, and how far both come apart."""
        before, self._disagreement = self._disagreement, _disagreement(last, now)
        if self._disagreement is None or now.ins is None:
            return
        self._is_flat = is_flat([one.ins for one in self._past if one.ins is not None])
        if before is not None:
            self._steps = min(self._steps + 1, _MEMORY_STEPS)
            self._square += (self._disagreement**2 - self._square) / self._steps
            self._product += (self._disagreement * before - self._product) / self._steps
        then = next(one for one in self._past if now.stamp_s - one.stamp_s <= _WANDER_S)
        span_s, apart = now.stamp_s - then.stamp_s, _disagreement(then, now)
        if apart is not None and span_s >= _MIN_WANDER_S:
            self._apart = min(self._apart + 1, _MEMORY_STEPS)
            square = apart**2 * (_WANDER_S / span_s)  # as of a random walk
            self._square_apart += (square - self._square_apart) / self._apart

    def _filter(self, last: _Moment, now: _Moment, covariance: Float64) -> Float64:
        """Predict the pose by the step of the odometry, correct it by the INS, and return its covariance."""
        of_ins, of_step = self._variances()
        back = _adjoint(inverse(now.odom_SE3_velo) @ last.odom_SE3_velo)
        covariance = back @ covariance @ back.T + np.diag(of_step)
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

    def _variances(self) -> tuple[Float64, Float64]:
        """Return the (6,) variances of a pose of the INS and of a step of the odometry."""
        least = np.repeat(_LEAST, 3) ** 2
        of_ins = np.clip(-self._product, 0.0, self._square / 2)
        return of_ins + least, self._square - 2 * of_ins + least


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
