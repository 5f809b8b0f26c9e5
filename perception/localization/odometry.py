"""LiDAR odometry: INS poses refined by registration, or registration alone.

The world frame of the refined poses starts as that of the INS and drifts from it slowly: a step is measured against a
recent scan, not against the earth. The obstacle stages need scans of the last second that agree to a centimetre,
which the INS does not give (measured on a KITTI drive: 23 cm between scans ten frames apart). Pulling the poses back
to the INS would break that agreement, so they are left to drift.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from itertools import product
from operator import itemgetter

import numpy as np

from perception.errors import PoseError
from perception.geometry.se3 import (
    from_motion_vector,
    inverse,
    motion_vector,
    orthonormal,
    rotation_angle_rad,
    transform_points,
)
from perception.localization.alignment import (
    Alignment,
    AlignmentKind,
    PreprocessedPoints,
    align,
    on_surfaces,
    preprocess_points,
    preprocess_target,
    share_on_surfaces,
)
from perception.localization.config import RegistrationConfig
from perception.localization.elevation_bias import ElevationBias, raised
from perception.localization.pose_covariance import registered_covariance, unregistered_covariance
from perception.types import Bool, Float32, Float64


class PoseOrigin(StrEnum):
    """Source of a pose."""

    START = "start"  # the first scan: the INS, or the world's origin without one
    REGISTERED = "registered"
    INS = "ins"  # registration was rejected, or the gap was too long for it
    EXTRAPOLATED = (
        "extrapolated"  # the same without INS: constant velocity since the last known pose
    )
    REPEATED = "repeated"  # a stamp that came before


@dataclass(frozen=True)
class Localization:
    """Pose of one scan.

    Attributes:
        world_SE3_velo: (4, 4) refined pose.
        origin: Source of the pose.
        inlier_ratio: Share of the scan that matched; 0 where nothing was registered.
        is_reset: Whether poses of earlier scans no longer fit to this one.
        covariance: (6, 6) covariance since the first scan, position in m and rotation vector in rad along the axes of the
            world.
        of_motion: (6, 6) covariance of the motion since the keyframe or, where nothing was registered, since the last
            scan: how well the pose fits those of the last scans.
    """

    world_SE3_velo: Float64
    origin: PoseOrigin
    inlier_ratio: float = 0.0
    is_reset: bool = False
    covariance: Float64 = field(default_factory=lambda: np.zeros((6, 6)))
    of_motion: Float64 = field(default_factory=lambda: np.zeros((6, 6)))


_EXACT = np.zeros((6, 6))  # covariance of what is known

# Alignments. A longer reach would match what moved.
_REACH_M = 0.5  # largest distance of a match
_MIN_INLIER_RATIO = 0.4  # of an accepted alignment, and how far it may correct its first guess
# Below this, one without prior is compared with those from other starts.
_CERTAIN_INLIER_RATIO = 0.5
_MAX_CORRECTION_M, _MAX_CORRECTION_RAD = 1.0, float(np.radians(4))
# What a vehicle changes its motion by, in m/s2 and rad/s2: a guess by velocity may be corrected by as much more.
_MANOEUVRE_M_S2, _MANOEUVRE_RAD_S2 = 5.0, 1.0
# Without INS, where no alignment is accepted: starts around the guess, how many of the motions found from them are looked
# at closely, and how many times as many points must speak for the best as for any other. The ground speaks for every motion:
# wherever the vehicle is, its rings lie on its surface.
_START_STEP_M, _START_STEP_RAD = 1.5, float(np.radians(8))
_MIN_CONTRAST, _APART_M, _APART_RAD = 1.1, 0.3, float(np.radians(2))
_MIN_SEARCHED_RATIO, _SEARCH_CANDIDATES = 0.3, 6
_MAX_UPRIGHT = 0.8  # vertical part of the normal of a surface that stands
# Where much moves, only points so near to the surfaces of the keyframes take part.
_SURFACE_M = 0.1
# Share of the matches that, with normals along a direction, tell as much about a motion in it as the INS step does; with
# fewer, as along a fence, the INS tells more.
_INS_PRIOR_SHARE = 0.006
_MAX_GAP_S = 1.1  # between two scans that are matched: one a second, with jitter

# A keyframe is replaced after this way or turn, or where fewer points match. Over the shorter way, what is static is told
# from vehicles that creep along.
_KEYFRAME_M, _KEYFRAME_RAD, _KEYFRAME_INLIER_RATIO = 5.0, float(np.radians(15)), 0.6
_MIN_KEYFRAME_M = 1.0
# A scan is matched with the last keyframes together: few beams see other rings of a surface from each place.
# More of them where much moves, as what stands between vehicles is seen from few places, and where scans are far apart: at
# 1 Hz rotations of a step are 5 to 10 % nearer to the truth with them, at 2 Hz and more they are not.
_KEYFRAMES, _MORE_KEYFRAMES, _FAR_APART_S = 3, 5, 0.7
# Share of a scan's points that move, from which on later scans are not aligned with them. Only some are known: the local area
# is smaller than the scan.
_MIN_MOVING_RATIO = 0.05

# Points this near to the surfaces of the keyframe speak for a motion. Another motion is a correction where this share of
# the scan's points more speak for it; the INS is believed where no more than that share fewer do.
_TIGHT_M, _MIN_SURFACE_GAIN, _MAX_INS_LOSS = 0.05, 0.025, 0.04
# First guesses without INS and history: speeds and turns that a vehicle may have, in steps that an alignment bridges.
_INITIAL_SPEED_M_S, _INITIAL_STEP_M = 30.0, 1.5
_INITIAL_TURN_RAD_S = float(np.radians(40))
# Without INS: distances ahead of the keyframe at which the scan may be, too; a part of them is tried at each scan.
_SEARCH_STEP_M, _SEARCH_PART_M, _SEARCH_M = 0.15, 4.0, 8.0
_SEARCH_BACK_M = 3.0
_SEARCH_POINTS = 1000  # of a scan; fewer miss the motion by chance
_SEARCH_LOSS = 0.02  # by which fewer of these may be on surfaces than at the motion found
# Of some of them, first: where so much fewer are, as at most motions, no more are looked at (three deviations).
_ROUGH_POINTS, _ROUGH_LOSS = 250, 0.1
# After a correction, until the moving points are known again, only what lies on surfaces takes part.
_CORRECTED_S = 1.0
# A step of one scan tells the velocity worse than the way since an older keyframe.
_MIN_STEADY_S = 0.45

# A vehicle neither turns nor accelerates faster; beyond that, an INS may jump by 2 m.
_MAX_TURN_RAD_S, _MAX_ACCELERATION_M_S2, _MAX_JUMP_M = 4.0, 20.0, 2.0


class _ScanPoints:
    """Points of a scan: all of them, and those that are not known to move."""

    def __init__(
        self, points_velo: Float32, config: RegistrationConfig, elevation_rad: float
    ) -> None:
        """Take the points, raised by the correction of the elevations so far."""
        self._stride = max(-(-len(points_velo) // config.max_points), 1)
        self._points_velo = raised(points_velo[:: self._stride], elevation_rad)
        self._config = config
        self._is_moving: Bool | None = None
        self.all = self._preprocess(self._points_velo)

    @property
    def is_crowded(self) -> bool:
        """Whether so much moves that it would pull an alignment along."""
        return self._is_moving is not None

    @cached_property
    def static(self) -> PreprocessedPoints:
        """Points that are not known to move."""
        if self._is_moving is None:
            return self.all
        return self._preprocess(self._static_velo)

    def mark_moving(self, is_moving: Bool) -> None:
        """Remember which (N,) points of the whole scan move."""
        is_moving = is_moving[:: self._stride]
        if is_moving.size and is_moving.mean() >= _MIN_MOVING_RATIO:
            self._is_moving = is_moving

    def forget_moving(self) -> None:
        """Forget which points move, where the poses that told it were wrong."""
        self._is_moving = None
        self.__dict__.pop("static", None)

    def raise_beams(self, angle_rad: float) -> None:
        """Move all points to elevations larger by an angle."""
        self._points_velo = raised(self._points_velo, angle_rad)
        self.all = self._preprocess(self._points_velo)
        self.__dict__.pop("static", None)

    def joined(self, others: Sequence[tuple["_ScanPoints", Float64]]) -> PreprocessedPoints:
        """Return the points of this scan and of others that are not known to move.

        Args:
            others: Points of other scans, each with the (4, 4) transform to this one.
        """
        if not others:
            return self.static
        moved = [transform_points(motion, other._static_velo[:, :3]) for other, motion in others]
        joined = np.concatenate([self._static_velo[:, :3], *moved])
        return preprocess_target(joined, self._config.voxel_size_m)

    @property
    def _static_velo(self) -> Float32:
        return self._points_velo if self._is_moving is None else self._points_velo[~self._is_moving]

    def _preprocess(self, points_velo: Float32) -> PreprocessedPoints:
        return preprocess_points(points_velo, self._config.voxel_size_m)


@dataclass(frozen=True)
class _LocatedScan:
    """State that later scans need of an earlier one."""

    stamp_s: float
    ins_world_SE3_velo: Float64 | None
    points: _ScanPoints
    localization: Localization
    velocity: Float64 | None  # (6,) rotation vector and translation a second, in the LiDAR frame


@dataclass(frozen=True)
class _Guess:
    """First guess of a motion.

    Attributes:
        motion: (4, 4) transform from the later scan to the earlier one.
        prior_share: Share of the matches that tell as much as it does; 0 where it is nothing but a start.
        gap_s: Time over which the motion may have changed, in seconds; 0 where an INS tells it.
    """

    motion: Float64
    prior_share: float = 0.0
    gap_s: float = 0.0

    def after(self, motion: Float64) -> "_Guess":
        """Return the guess of an earlier motion and this one."""
        return replace(self, motion=motion @ self.motion)


class LidarOdometry:
    """Estimates the pose of each scan of a drive in turn, registering each once.

    A scan is matched (GICP) with the last keyframes, of which the newest is at most a few metres back: errors add up
    once a keyframe, not once a scan.

    In dense traffic most surfaces around come along with the vehicle, and the nearest minimum is that of the traffic.
    But vehicles never keep their distances to a few centimetres, and what is static does: over a metre or more, more
    points lie on the surfaces of the keyframe at the true motion than at any other. So a keyframe is at least so far
    back, and another motion since the keyframe is tried: that of the INS, or the distance ahead that brings most points
    onto surfaces. Where much moves, keyframes leave it out, and a scan is matched by what lies on their surfaces where
    the INS or the motion so far puts it: vehicles that came less than the reach of a match would pull the pose along.

    Beside a fence or between even walls, points barely tell how far the vehicle came, and matches slip along by the
    pattern of the voxels. There the step of the INS decides; where points tell the motion, it does not pull. A constant
    velocity does not decide: what a slip makes of it would go on.
    """

    def __init__(self, config: RegistrationConfig | None = None) -> None:
        self._config = config or RegistrationConfig()
        self._last: _LocatedScan | None = None
        self._keyframe: _LocatedScan
        # The last keyframes, their static points in the frame of the newest, made at the next scan, when it is known what
        # moves; and with the newest some later scans.
        self._keyframes: deque[_LocatedScan] = deque(maxlen=_MORE_KEYFRAMES)
        self._surroundings: PreprocessedPoints | None = None
        self._since: deque[_LocatedScan] = deque(maxlen=16)
        self._corrected_s, self._searched_m = -np.inf, 0.0
        self._gap_s = 0.0  # between the last two scans
        # What later stages get are the points as measured: cameras are calibrated to them, and range images go by them.
        # Scans as measured fit each other best at the motion as measured. So elevations are corrected where no INS keeps
        # the path from tilting.
        self._elevation = ElevationBias()
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
        self._gap_s = gap_s
        points = _ScanPoints(points_velo, self._config, self._elevation.correction_rad)
        localization = self._locate(points, stamp_s, ins_world_SE3_velo, last)
        # After a correction the last pose no longer tells the velocity, but the keyframe's does.
        is_corrected = localization.is_reset and localization.origin is PoseOrigin.REGISTERED
        velocity = _velocity(self._keyframe if is_corrected else last, localization, stamp_s)
        if localization.origin is not PoseOrigin.EXTRAPOLATED:
            self._known_s = stamp_s
        elif localization.is_reset:
            velocity = None
        self._last = _LocatedScan(stamp_s, ins_world_SE3_velo, points, localization, velocity)
        self._update_keyframe(self._last, last)
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
        points = _ScanPoints(points_velo, self._config, self._elevation.correction_rad)
        self._last = _LocatedScan(stamp_s, ins_world_SE3_velo, points, localization, None)
        self._set_keyframe(self._last)
        return localization

    def _check_motion(
        self, step: Float64, gap_s: float, velocity: Float64 | None, source: str
    ) -> None:
        travel_m = _length_m(step)
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
        points: _ScanPoints,
        stamp_s: float,
        ins_world_SE3_velo: Float64 | None,
        last: _LocatedScan,
    ) -> Localization:
        """Register the scan with the keyframe; otherwise use the INS, or constant velocity."""
        gap_s, last_pose = stamp_s - last.stamp_s, last.localization.world_SE3_velo
        step_ins = _step(last.ins_world_SE3_velo, ins_world_SE3_velo)
        is_near = gap_s <= _MAX_GAP_S
        if is_near:
            world_SE3_keyframe = self._keyframe.localization.world_SE3_velo
            steps = self._guess_motions(
                step_ins, last.velocity, gap_s, unknown_s=stamp_s - self._known_s
            )
            guesses = [step.after(inverse(world_SE3_keyframe) @ last_pose) for step in steps]
            motion_ins = _step(self._keyframe.ins_world_SE3_velo, ins_world_SE3_velo)
            of_static = None
            if last.points.is_crowded or stamp_s - self._corrected_s < _CORRECTED_S:
                motion = self._steady_motion(last, gap_s)
                if motion_ins is not None and self._is_plausible(points.all, motion_ins, motion):
                    motion = motion_ins
                of_static = self._static_alignment(points.all, replace(guesses[0], motion=motion))
            carried = of_static or self._best_alignment(points.all, guesses)
            other = self._correction(points.all, stamp_s, motion_ins, carried)
            if other is not None:
                self._corrected_s = stamp_s
                self._keyframe.points.forget_moving()
                self._keyframes.clear()
                self._surroundings = self._keyframe.points.all
            best = other or carried
            if best is not None:
                pose = _rounded(world_SE3_keyframe @ best.target_SE3_source)
                covariance, of_motion = (
                    registered_covariance(before, world_SE3_keyframe, best.covariance, pose)
                    for before in (self._keyframe.localization.covariance, _EXACT)
                )
                if not np.isfinite(of_motion).all():
                    of_motion = unregistered_covariance(_EXACT, pose, pose, gap_s)
                return Localization(
                    pose,
                    PoseOrigin.REGISTERED,
                    best.inlier_ratio,
                    is_reset=other is not None,
                    covariance=covariance,
                    of_motion=of_motion,
                )
        step = _extrapolate(last.velocity, gap_s) if step_ins is None else step_ins
        origin = PoseOrigin.EXTRAPOLATED if step_ins is None else PoseOrigin.INS
        # Later scans may still find the keyframe; when that is too long ago, the poses are reset.
        is_lost = step_ins is None and stamp_s - self._keyframe.stamp_s > _MAX_GAP_S
        pose = last_pose @ step
        has_motion = step_ins is not None or last.velocity is not None
        covariance, of_motion = (
            unregistered_covariance(before, last_pose, pose, gap_s, has_motion=has_motion)
            for before in (last.localization.covariance, _EXACT)
        )
        is_reset = not is_near or is_lost
        return Localization(
            pose, origin, is_reset=is_reset, covariance=covariance, of_motion=of_motion
        )

    def _is_plausible(self, points: PreprocessedPoints, motion: Float64, other: Float64) -> bool:
        """Return whether a motion brings hardly fewer points onto static surfaces than another."""
        sample, target = points.thinned(_SEARCH_POINTS), self._keyframe.points.static
        shares = [self._share(sample, target, one) for one in (motion, other)]
        return shares[0] > shares[1] - _MAX_INS_LOSS

    def _steady_motion(self, last: _LocatedScan, gap_s: float) -> Float64:
        """Return the motion since the keyframe at the velocity since then, or, where it is too young, the last one."""
        velocity = last.velocity
        if last.stamp_s - self._keyframe.stamp_s >= _MIN_STEADY_S:
            velocity = _velocity(self._keyframe, last.localization, last.stamp_s)
        return _motion(self._keyframe, last) @ _extrapolate(velocity, gap_s)

    def _correction(
        self,
        points: PreprocessedPoints,
        stamp_s: float,
        motion_ins: Float64 | None,
        carried: Alignment | None,
    ) -> Alignment | None:
        """Return the alignment from another motion since the keyframe, where more points speak for it.

        All points are compared: what is called moving depends on the poses. But what has been seen to move does not
        speak for a shorter way. Where the vehicle seems to stand among what may come along with it, the INS is believed
        against a few more points.
        """
        if carried is None:
            return None
        found = carried.target_SE3_source
        guess = motion_ins
        if guess is None:
            guess = self._search_ahead(points, stamp_s, found)
        if guess is None or not self._is_apart(guess, found):
            return None
        # A few points tell mostly that both come to the same motion.
        if self._surface_alignment(points.thinned(_SEARCH_POINTS), guess, found) is None:
            return None
        other = self._surface_alignment(points, guess, found)
        if other is None:
            return None
        is_farther = other.target_SE3_source[0, 3] > found[0, 3]
        keyframe, min_gain = self._keyframe.points, _MIN_SURFACE_GAIN
        if is_farther and motion_ins is not None and found[0, 3] < _MIN_KEYFRAME_M:
            min_gain = -_MAX_INS_LOSS
        target = keyframe.all if is_farther else keyframe.static
        shares = [self._share(points, target, one.target_SE3_source) for one in (carried, other)]
        return other if shares[1] - shares[0] > min_gain else None

    def _search_ahead(
        self, points: PreprocessedPoints, stamp_s: float, found: Float64
    ) -> Float64 | None:
        """Return the motion, farther or less far ahead than the one found, that brings most points onto surfaces.

        Each call tries the next part of the way. The farther back the keyframe, the fewer of its surfaces are seen
        again, but traffic that comes along is seen as before: after a few metres no shorter way is tried.
        """
        travelled_m = self._config.max_speed_m_s * (stamp_s - self._keyframe.stamp_s)
        end_m = min(_SEARCH_M, travelled_m)
        start_m = self._searched_m if self._searched_m < end_m else 0.0
        self._searched_m = start_m + _SEARCH_PART_M
        if found[0, 3] > _SEARCH_BACK_M:
            start_m = max(start_m, float(found[0, 3]))
        sample = points.thinned(_SEARCH_POINTS)
        rough, target = sample.thinned(_ROUGH_POINTS), self._keyframe.points.all
        best, most = None, self._share(sample, target, found) - _SEARCH_LOSS
        for ahead_m in np.arange(start_m, min(end_m, self._searched_m), _SEARCH_STEP_M):
            motion = found.copy()
            motion[0, 3] = ahead_m
            if not self._is_apart(motion, found):
                continue
            if self._share(rough, target, motion) < most - _ROUGH_LOSS:
                continue
            share = self._share(sample, target, motion)
            if share > most:
                best, most = motion, share
        return best

    def _share(
        self, points: PreprocessedPoints, target: PreprocessedPoints, motion: Float64
    ) -> float:
        """Return the share of points that a motion brings onto surfaces of the keyframe."""
        return share_on_surfaces(points, target, motion, _TIGHT_M)

    def _surface_alignment(
        self, points: PreprocessedPoints, motion: Float64, carried: Float64
    ) -> Alignment | None:
        """Align what a motion brings onto surfaces, and once more what that brings there, unless it is the carried one."""
        found, target = None, self._keyframe.points.all
        for _ in range(2):
            kept = on_surfaces(points, target, motion, _SURFACE_M)
            found = self._align(target, kept, _Guess(motion))
            if found is None:
                return None
            motion = found.target_SE3_source
            if not self._is_apart(motion, carried):
                return None
        return found

    def _is_apart(self, motion: Float64, other: Float64) -> bool:
        """Return whether two motions are so far apart that they do not converge to the same one."""
        return _length_m(motion - other) >= _REACH_M / 2

    def _update_keyframe(self, scan: _LocatedScan, last: _LocatedScan) -> None:
        """Replace the keyframe where it is too far back, by a scan that is far enough back."""
        origin = scan.localization.origin
        if origin is PoseOrigin.EXTRAPOLATED and not scan.localization.is_reset:
            return
        moved = _motion(self._keyframe, scan)
        turns = rotation_angle_rad(moved) > _KEYFRAME_RAD
        if turns or origin is not PoseOrigin.REGISTERED:
            self._set_keyframe(scan)
            return
        if _length_m(_motion(self._since[-1], scan)) >= _MIN_KEYFRAME_M / 2:
            self._since.append(scan)
        is_worn = scan.localization.inlier_ratio < _KEYFRAME_INLIER_RATIO
        is_passed = _length_m(moved) > _KEYFRAME_M
        has_ins = scan.ins_world_SE3_velo is not None
        if is_passed and not has_ins and self._correct_elevations(scan, moved):
            return
        if is_worn or is_passed:
            step_m = _length_m(_motion(last, scan))
            for earlier in reversed(self._since):
                away_m = _length_m(_motion(earlier, scan)) + step_m
                is_far = away_m >= _MIN_KEYFRAME_M
                if is_far and earlier is not self._keyframe:
                    self._set_keyframe(earlier)
                    return

    def _correct_elevations(self, scan: _LocatedScan, moved: Float64) -> bool:
        """Take the pair of a scan and the keyframe; where it proves a bias, raise all points so far."""
        more_rad = self._elevation.update(self._keyframe.points.static, scan.points.all, moved)
        if more_rad == 0:
            return False
        self._set_keyframe(scan)
        for one in self._keyframes:
            one.points.raise_beams(more_rad)
        return True

    def _set_keyframe(self, scan: _LocatedScan) -> None:
        if scan.localization.origin is not PoseOrigin.REGISTERED or scan.localization.is_reset:
            self._keyframes.clear()  # where they are from here is not known well enough
        self._keyframe, self._surroundings = scan, None
        self._keyframes.append(scan)
        self._since.clear()
        self._since.append(scan)

    def _join_keyframes(self) -> PreprocessedPoints:
        """Return the static points of the last keyframes in the frame of the newest."""
        if self._surroundings is None:
            newest = self._keyframe
            are_more = newest.points.is_crowded or self._gap_s > _FAR_APART_S
            count = _MORE_KEYFRAMES if are_more else _KEYFRAMES
            others = [one for one in self._keyframes if one is not newest][1 - count :]
            self._surroundings = newest.points.joined(
                [(one.points, _motion(newest, one)) for one in others]
            )
        return self._surroundings

    def _guess_motions(
        self, step_ins: Float64 | None, velocity: Float64 | None, gap_s: float, unknown_s: float
    ) -> list[_Guess]:
        """Return guesses of the motion since the last scan, and since when the velocity is unknown."""
        if velocity is None and step_ins is None:
            turns_rad = _around(_INITIAL_TURN_RAD_S * gap_s, _START_STEP_RAD)
            ways_m = np.arange(0.0, _INITIAL_SPEED_M_S * gap_s + _INITIAL_STEP_M, _INITIAL_STEP_M)
            return [
                _Guess(
                    from_motion_vector(np.array([0, 0, turn_rad, way_m, turn_rad * way_m / 2, 0])),
                    gap_s=unknown_s,
                )
                for turn_rad, way_m in product(turns_rad, ways_m)
            ]
        guesses = [] if step_ins is None else [_Guess(step_ins, _INS_PRIOR_SHARE)]
        if velocity is not None:
            constant = _extrapolate(velocity, gap_s)
            # Within reach of each other the two guesses converge to the same pose.
            if step_ins is None or _is_another(step_ins, constant):
                guesses.append(_Guess(constant, gap_s=unknown_s))
        return guesses

    def _best_alignment(
        self, source: PreprocessedPoints, guesses: Sequence[_Guess]
    ) -> Alignment | None:
        """Align with the keyframe from each guess, and return the best accepted alignment."""
        target = self._join_keyframes()
        if len(guesses) > 2:  # at the start
            return self._searched_alignment(source, [one.motion for one in guesses])
        alignments = [self._align(target, source, guess) for guess in guesses]
        accepted = [alignment for alignment in alignments if alignment is not None]
        best = min(accepted, key=lambda alignment: alignment.cost, default=None)
        if any(guess.prior_share for guess in guesses):
            return best
        if best is not None and best.inlier_ratio >= _CERTAIN_INLIER_RATIO:
            return best
        # What hardly matches may be another motion than the true one.
        searched = self._searched_alignment(source, _starts(guesses[0]))
        found = [one for one in (best, searched) if one is not None]
        return min(found, key=lambda alignment: alignment.cost, default=None)

    def _searched_alignment(
        self, points: PreprocessedPoints, starts: Sequence[Float64]
    ) -> Alignment | None:
        """Align from many motions, and return the alignment that clearly more of them speak for than for any other."""
        target, sample = self._join_keyframes(), points.thinned(_SEARCH_POINTS)
        motions = [align(target, sample, start, _REACH_M).target_SE3_source for start in starts]
        motions.sort(key=lambda motion: _standing_share(sample, target, motion), reverse=True)
        found: list[tuple[float, Alignment]] = []
        for motion in motions:
            if all(_is_another(motion, one.target_SE3_source) for _, one in found):
                close = align(target, points, motion, _REACH_M)
                if not close.is_converged:  # far from its start, iterations run out
                    close = align(target, points, close.target_SE3_source, _REACH_M)
                found.append((_standing_share(points, target, close.target_SE3_source), close))
            if len(found) == _SEARCH_CANDIDATES:
                break
        share, best = max(found, key=itemgetter(0))
        others, settled = list[float](), list[Alignment]()
        for other, one in found:
            if _is_another(one.target_SE3_source, best.target_SE3_source):
                others.append(other)
            elif one.is_converged and one.inlier_ratio >= _MIN_SEARCHED_RATIO:
                settled.append(one)
        is_proven = share >= _MIN_CONTRAST * max(others, default=0.0)
        return min(settled, key=lambda one: one.cost, default=None) if is_proven else None

    def _static_alignment(self, points: PreprocessedPoints, guess: _Guess) -> Alignment | None:
        """Align what lies on static surfaces: what moved less than the reach of a match would pull the pose along."""
        keyframe, target = self._keyframe.points, self._join_keyframes()
        kept = on_surfaces(points, target, guess.motion, _SURFACE_M)
        found = self._align(target, kept, guess, "robust")
        if found is None:
            return None
        share = len(kept) / len(points) / (len(keyframe.static) / len(keyframe.all))
        ratio = min(1.0, found.inlier_ratio * share)
        return replace(found, inlier_ratio=ratio) if ratio >= _MIN_INLIER_RATIO else None

    def _align(
        self,
        target: PreprocessedPoints,
        source: PreprocessedPoints,
        guess: _Guess,
        kind: AlignmentKind = "GICP",
    ) -> Alignment | None:
        """Align from a guess, and return the alignment where it is accepted."""
        found = align(target, source, guess.motion, _REACH_M, kind, guess.prior_share)
        correction = inverse(guess.motion) @ found.target_SE3_source
        is_accepted = (
            found.is_converged
            and found.inlier_ratio >= _MIN_INLIER_RATIO
            and _length_m(correction) <= _MAX_CORRECTION_M + _MANOEUVRE_M_S2 * guess.gap_s**2
            and rotation_angle_rad(correction)
            <= _MAX_CORRECTION_RAD + _MANOEUVRE_RAD_S2 * guess.gap_s**2
        )
        return found if is_accepted else None


def _standing_share(
    points: PreprocessedPoints, target: PreprocessedPoints, motion: Float64
) -> float:
    """Return the share of the points off the ground that a motion brings onto surfaces."""
    standing = replace(
        points, surfaces=points.surfaces[np.abs(points.surfaces[:, 5]) < _MAX_UPRIGHT]
    )
    return share_on_surfaces(standing, target, motion, _SURFACE_M)


def _is_another(motion: Float64, other: Float64) -> bool:
    """Return whether two alignments found different motions."""
    between = inverse(motion) @ other
    return _length_m(between) > _APART_M or rotation_angle_rad(between) > _APART_RAD


def _starts(guess: _Guess) -> list[Float64]:
    """Return motions around a guess, as far as a vehicle may change its motion in the gap."""
    turns_rad = _around(_MANOEUVRE_RAD_S2 * guess.gap_s**2, _START_STEP_RAD)
    ways_m = _around(_MANOEUVRE_M_S2 * guess.gap_s**2, _START_STEP_M)
    return [
        guess.motion @ from_motion_vector(np.array([0, 0, turn_rad, way_m, 0, 0]))
        for turn_rad, way_m in product(turns_rad, ways_m)
    ]


def _around(reach: float, step: float) -> Float64:
    """Return values from minus to plus a reach, in steps from 0."""
    return step * np.arange(-np.ceil(reach / step), np.ceil(reach / step) + 1)


def _motion(earlier: _LocatedScan, scan: _LocatedScan) -> Float64:
    return inverse(earlier.localization.world_SE3_velo) @ scan.localization.world_SE3_velo


def _length_m(motion: Float64) -> float:
    return float(np.linalg.norm(motion[:3, 3]))


def _velocity(earlier: _LocatedScan, now: Localization, stamp_s: float) -> Float64 | None:
    if now.origin not in (PoseOrigin.REGISTERED, PoseOrigin.INS):
        return earlier.velocity
    step = inverse(earlier.localization.world_SE3_velo) @ now.world_SE3_velo
    return motion_vector(step) / (stamp_s - earlier.stamp_s)


def _step(world_SE3_before: Float64 | None, world_SE3_now: Float64 | None) -> Float64 | None:
    if world_SE3_before is None or world_SE3_now is None:
        return None
    return inverse(world_SE3_before) @ world_SE3_now


def _extrapolate(velocity: Float64 | None, gap_s: float) -> Float64:
    return np.eye(4) if velocity is None else from_motion_vector(velocity * gap_s)


def _rounded(pose: Float64) -> Float64:
    """Drop the last digits, which depend on the order in which threads add up.

    Without it the skew of rounding would double with every keyframe.
    """
    return orthonormal(np.round(pose, 10))
