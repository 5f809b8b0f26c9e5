"""LiDAR odometry: INS poses refined by registration, or registration alone.

The world frame of the refined poses starts as that of the INS and drifts from it slowly: a step is measured against a
recent scan, not against the earth. The obstacle stages need scans of the last second that agree to a centimetre,
which the INS does not give (measured on a KITTI drive: 23 cm between scans ten frames apart). Pulling the poses back
to the INS would break that agreement, so they are left to drift.
"""

from dataclasses import replace

import numpy as np

from perception.errors import PoseError
from perception.geometry.se3 import inverse, orthonormal, rotation_angle_rad
from perception.localization.alignment import Alignment
from perception.localization.config import RegistrationConfig
from perception.localization.dense_traffic import DenseTraffic
from perception.localization.elevation_bias import ElevationBias
from perception.localization.keyframes import Keyframes
from perception.localization.located_scan import (
    Localization,
    LocatedScan,
    PoseOrigin,
    RegistrationPoints,
    UnlocatedScan,
)
from perception.localization.motion_search import (
    best_alignment,
    extrapolate,
    guess_motions,
    length_m,
)
from perception.localization.pose_covariance import registered_covariance, unregistered_covariance
from perception.types import Bool, Float32, Float64

_EXACT = np.zeros((6, 6))  # covariance of what is known
_MAX_GAP_S = 1.1  # between two scans that are matched: one a second, with jitter
# A vehicle neither turns nor accelerates faster; beyond that, an INS may jump by 2 m.
_MAX_TURN_RAD_S, _MAX_ACCELERATION_M_S2, _MAX_JUMP_M = 4.0, 20.0, 2.0


class LidarOdometry:
    """Estimates the pose of each scan of a drive in turn, registering each once.

    A scan is matched (GICP) with the last keyframes, of which the newest is at most a few metres back: errors add up
    once a keyframe, not once a scan. Where much moves, keyframes leave it out, and `DenseTraffic` keeps what comes
    along from carrying the pose: for that the newest keyframe is at least a metre back.

    Beside a fence or between even walls, points barely tell how far the vehicle came, and matches slip along by the
    pattern of the voxels. There the step of the INS decides; where points tell the motion, it does not pull. A constant
    velocity does not decide: what a slip makes of it would go on.
    """

    def __init__(self, config: RegistrationConfig | None = None) -> None:
        self._config = config or RegistrationConfig()
        self._last: LocatedScan | None = None
        # What later stages get are the points as measured: cameras are calibrated to them, and range images go by them.
        # Scans as measured fit each other best at the motion as measured. So elevations are corrected where no INS keeps
        # the path from tilting.
        self._elevation = ElevationBias()
        self._keyframes = Keyframes(self._elevation)
        self._traffic = DenseTraffic(self._config.max_speed_m_s)
        self._known_s = -np.inf  # the last scan whose pose is not that of a constant velocity

    def update(
        self,
        points_velo: Float32,
        stamp_s: float,
        ins_world_SE3_velo: Float64 | None = None,
        source: str = "frame",
    ) -> Localization:
        """Return the pose of the scan.

        Args:
            points_velo: (N, 3+) the whole scan.
            stamp_s: Time of the scan in seconds; a repeated stamp repeats the pose.
            ins_world_SE3_velo: (4, 4) INS pose of the LiDAR, or None.
            source: Name of the scan, for the error message.

        Raises:
            PoseError: stamps run backwards, or the INS moves as no vehicle does.
        """
        if ins_world_SE3_velo is not None:
            ins_world_SE3_velo = orthonormal(ins_world_SE3_velo)
        last = self._last
        if last is None:
            return self._start(points_velo, stamp_s, ins_world_SE3_velo)
        gap_s = stamp_s - last.stamp_s
        if gap_s < 0:
            raise PoseError(
                source,
                expected="stamps that rise",
                found=f"a step of {gap_s:.3f} s",
                advice="put the frames in the order of their stamps",
            )
        if gap_s == 0:
            return replace(last.localization, origin=PoseOrigin.REPEATED, is_reset=False)
        step_ins = _step(last.ins_world_SE3_velo, ins_world_SE3_velo)
        if step_ins is not None:
            # Where the INS itself gave the last pose, its error is part of the velocity.
            is_registered = last.localization.origin is PoseOrigin.REGISTERED
            self._check_motion(step_ins, gap_s, last.velocity if is_registered else None, source)
        points = RegistrationPoints(points_velo, self._config, self._elevation.correction_rad)
        localization = self._locate(points, stamp_s, ins_world_SE3_velo, last)
        # After a correction the last pose no longer tells the velocity, but the keyframe's does.
        is_corrected = localization.is_reset and localization.origin is PoseOrigin.REGISTERED
        known = self._keyframes.newest if is_corrected else last
        velocity = known.velocity_to(localization, stamp_s)
        if localization.origin is not PoseOrigin.EXTRAPOLATED:
            self._known_s = stamp_s
        elif localization.is_reset:
            velocity = None
        self._last = LocatedScan(stamp_s, ins_world_SE3_velo, points, localization, velocity)
        self._keyframes.update(self._last, last)
        return localization

    def mark_moving(self, is_moving: Bool) -> None:
        """Remember which (N,) points of the last scan move: later scans are not aligned with them."""
        if self._last is not None:
            self._last.points.mark_moving(is_moving)

    def _start(
        self, points_velo: Float32, stamp_s: float, ins_world_SE3_velo: Float64 | None
    ) -> Localization:
        pose = np.eye(4) if ins_world_SE3_velo is None else ins_world_SE3_velo
        localization = Localization(pose, PoseOrigin.START, is_reset=True)
        self._known_s = stamp_s
        points = RegistrationPoints(points_velo, self._config, self._elevation.correction_rad)
        self._last = LocatedScan(stamp_s, ins_world_SE3_velo, points, localization, None)
        self._keyframes.replace_newest(self._last)
        return localization

    def _check_motion(
        self, step: Float64, gap_s: float, velocity: Float64 | None, source: str
    ) -> None:
        travel_m = length_m(step)
        turn_rad = rotation_angle_rad(step)
        unexplained_m = 0.0
        if velocity is not None and gap_s <= _MAX_GAP_S:
            unexplained_m = float(np.linalg.norm(step[:3, 3] - velocity[3:] * gap_s))
        if (
            travel_m > self._config.max_speed_m_s * gap_s
            or turn_rad > _MAX_TURN_RAD_S * gap_s
            or unexplained_m > _MAX_JUMP_M + _MAX_ACCELERATION_M_S2 * gap_s**2
        ):
            raise PoseError(
                source,
                expected="an INS pose that a vehicle can reach from the one before",
                found=f"a jump of {travel_m:.2f} m and {np.degrees(turn_rad):.1f} deg "
                f"in {gap_s:.3f} s, {unexplained_m:.2f} m beside the motion so far",
                advice="repair the INS rows there, or run without INS",
            )

    def _locate(
        self,
        points: RegistrationPoints,
        stamp_s: float,
        ins_world_SE3_velo: Float64 | None,
        last: LocatedScan,
    ) -> Localization:
        """Register the scan with the keyframes; otherwise use the INS, or constant velocity."""
        gap_s, keyframe = stamp_s - last.stamp_s, self._keyframes.newest
        step_ins = _step(last.ins_world_SE3_velo, ins_world_SE3_velo)
        if gap_s <= _MAX_GAP_S:
            scan = UnlocatedScan(
                points.all,
                stamp_s,
                keyframe,
                self._keyframes.surroundings(gap_s),
                _step(keyframe.ins_world_SE3_velo, ins_world_SE3_velo),
            )
            carried = self._carried_alignment(scan, last, step_ins)
            if carried is not None:
                other = self._traffic.correction(scan, carried)
                if other is not None:
                    self._keyframes.forget_moving()
                return _registered(
                    keyframe, other or carried, gap_s, is_corrected=other is not None
                )
        # Later scans may still find the keyframe; when that is too long ago, the poses are reset.
        is_lost = step_ins is None and stamp_s - keyframe.stamp_s > _MAX_GAP_S
        return _carried_on(last, step_ins, gap_s, is_reset=gap_s > _MAX_GAP_S or is_lost)

    def _carried_alignment(
        self, scan: UnlocatedScan, last: LocatedScan, step_ins: Float64 | None
    ) -> Alignment | None:
        """Align the scan from the guesses of its motion since the last one."""
        gap_s, unknown_s = scan.stamp_s - last.stamp_s, scan.stamp_s - self._known_s
        keyframe_SE3_last = scan.keyframe.motion_to(last)
        guesses = [
            step.after(keyframe_SE3_last)
            for step in guess_motions(step_ins, last.velocity, gap_s, unknown_s)
        ]
        of_static = self._traffic.static_alignment(scan, last, guesses[0])
        return of_static or best_alignment(scan.surroundings, scan.points, guesses)


def _registered(
    keyframe: LocatedScan, found: Alignment, gap_s: float, *, is_corrected: bool
) -> Localization:
    """Return the pose of a scan by its alignment with a keyframe."""
    before = keyframe.localization
    pose = _rounded(before.world_SE3_velo @ found.target_SE3_source)
    covariance, of_motion = (
        registered_covariance(of_keyframe, before.world_SE3_velo, found.covariance, pose)
        for of_keyframe in (before.covariance, _EXACT)
    )
    if not np.isfinite(of_motion).all():
        of_motion = unregistered_covariance(_EXACT, pose, pose, gap_s)
    return Localization(
        pose, PoseOrigin.REGISTERED, found.inlier_ratio, is_corrected, covariance, of_motion
    )


def _carried_on(
    last: LocatedScan, step_ins: Float64 | None, gap_s: float, *, is_reset: bool
) -> Localization:
    """Return the pose of a scan by the INS, or at constant velocity."""
    before = last.localization
    step = extrapolate(last.velocity, gap_s) if step_ins is None else step_ins
    pose = before.world_SE3_velo @ step
    has_motion = step_ins is not None or last.velocity is not None
    covariance, of_motion = (
        unregistered_covariance(of_last, before.world_SE3_velo, pose, gap_s, has_motion=has_motion)
        for of_last in (before.covariance, _EXACT)
    )
    origin = PoseOrigin.EXTRAPOLATED if step_ins is None else PoseOrigin.INS
    return Localization(pose, origin, is_reset=is_reset, covariance=covariance, of_motion=of_motion)


def _step(world_SE3_before: Float64 | None, world_SE3_now: Float64 | None) -> Float64 | None:
    if world_SE3_before is None or world_SE3_now is None:
        return None
    return inverse(world_SE3_before) @ world_SE3_now


def _rounded(pose: Float64) -> Float64:
    """Drop the last digits, which depend on the order in which threads add up.

    Without it the skew of rounding would double with every keyframe.
    """
    return orthonormal(np.round(pose, 10))
