"""The motion among vehicles that come along: the alignment that they do not carry.

In dense traffic most surfaces around come along with the vehicle, and the nearest minimum is that of the traffic. But
vehicles never keep their distances to a few centimetres, and what is static does: over a metre or more, more points lie
on the surfaces of the keyframe at the true motion than at any other.
"""

from dataclasses import replace

import numpy as np

from perception.localization.alignment import (
    Alignment,
    PreprocessedPoints,
    on_surfaces,
    share_on_surfaces,
)
from perception.localization.keyframes import MIN_KEYFRAME_M
from perception.localization.located_scan import LocatedScan, UnlocatedScan
from perception.localization.motion_search import (
    MIN_INLIER_RATIO,
    REACH_M,
    SEARCH_POINTS,
    SURFACE_M,
    Guess,
    accepted_alignment,
    extrapolate,
    length_m,
)
from perception.types import Float64

# Points this near to the surfaces of the keyframe speak for a motion. Another motion is a correction where this share of
# the scan's points more speak for it; the INS is believed where no more than that share fewer do.
_TIGHT_M, _MIN_SURFACE_GAIN, _MAX_INS_LOSS = 0.05, 0.025, 0.04
# Without INS: distances ahead of the keyframe at which the scan may be, too; a part of them is tried at each scan.
_SEARCH_STEP_M, _SEARCH_PART_M, _SEARCH_M = 0.15, 4.0, 8.0
_SEARCH_BACK_M = 3.0
_SEARCH_LOSS = 0.02  # by which fewer of the sample may be on surfaces than at the motion found
# Of some of them, first: where so much fewer are, as at most motions, no more are looked at (three deviations).
_ROUGH_POINTS, _ROUGH_LOSS = 250, 0.1
# After a correction, until the moving points are known again, only what lies on surfaces takes part.
_CORRECTED_S = 1.0
# A step of one scan tells the velocity worse than the way since an older keyframe.
_MIN_STEADY_S = 0.45


class DenseTraffic:
    """Tells the motion of the vehicle from that of the traffic around it."""

    def __init__(self, max_speed_m_s: float) -> None:
        """Take the largest speed of the vehicle."""
        self._max_speed_m_s = max_speed_m_s
        self._corrected_s, self._searched_m = -np.inf, 0.0

    def static_alignment(
        self, scan: UnlocatedScan, last: LocatedScan, guess: Guess
    ) -> Alignment | None:
        """Align what lies on static surfaces, where much moves: what moved less than the reach of a match pulls the pose along.

        Args:
            scan: The scan.
            last: The one before it.
            guess: First guess of the motion where nothing moves.
        """
        if not (last.points.is_crowded or scan.stamp_s - self._corrected_s < _CORRECTED_S):
            return None
        motion = _steady_motion(scan, last)
        if scan.motion_ins is not None and _is_plausible(scan, scan.motion_ins, motion):
            motion = scan.motion_ins
        keyframe, points = scan.keyframe.points, scan.points
        kept = on_surfaces(points, scan.surroundings, motion, SURFACE_M)
        guess = replace(guess, motion=motion)
        found = accepted_alignment(scan.surroundings, kept, guess, "robust")
        if found is None:
            return None
        share = len(kept) / len(points) / (len(keyframe.static) / len(keyframe.all))
        ratio = min(1.0, found.inlier_ratio * share)
        return replace(found, inlier_ratio=ratio) if ratio >= MIN_INLIER_RATIO else None

    def correction(self, scan: UnlocatedScan, carried: Alignment) -> Alignment | None:
        """Return the alignment from another motion since the keyframe, where more points speak for it.

        All points are compared: what is called moving depends on the poses. But what has been seen to move does not
        speak for a shorter way. Where the vehicle seems to stand among what may come along with it, the INS is believed
        against a few more points.

        Args:
            scan: The scan.
            carried: Its alignment, which the traffic may have carried.
        """
        points, found = scan.points, carried.target_SE3_source
        guess = scan.motion_ins
        if guess is None:
            guess = self._search_ahead(scan, found)
        if guess is None or not _is_apart(guess, found):
            return None
        keyframe = scan.keyframe.points
        # A few points tell mostly that both come to the same motion.
        if _surface_alignment(points.thinned(SEARCH_POINTS), keyframe.all, guess, found) is None:
            return None
        other = _surface_alignment(points, keyframe.all, guess, found)
        if other is None:
            return None
        is_farther = other.target_SE3_source[0, 3] > found[0, 3]
        min_gain = _MIN_SURFACE_GAIN
        if is_farther and scan.motion_ins is not None and found[0, 3] < MIN_KEYFRAME_M:
            min_gain = -_MAX_INS_LOSS
        target = keyframe.all if is_farther else keyframe.static
        shares = [_share(points, target, one.target_SE3_source) for one in (carried, other)]
        if shares[1] - shares[0] <= min_gain:
            return None
        self._corrected_s = scan.stamp_s
        return other

    def _search_ahead(self, scan: UnlocatedScan, found: Float64) -> Float64 | None:
        """Return the motion, farther or less far ahead than the one found, that brings most points onto surfaces.

        Each call tries the next part of the way. The farther back the keyframe, the fewer of its surfaces are seen
        again, but traffic that comes along is seen as before: after a few metres no shorter way is tried.
        """
        travelled_m = self._max_speed_m_s * (scan.stamp_s - scan.keyframe.stamp_s)
        end_m = min(_SEARCH_M, travelled_m)
        start_m = self._searched_m if self._searched_m < end_m else 0.0
        self._searched_m = start_m + _SEARCH_PART_M
        if found[0, 3] > _SEARCH_BACK_M:
            start_m = max(start_m, float(found[0, 3]))
        sample = scan.points.thinned(SEARCH_POINTS)
        rough, target = sample.thinned(_ROUGH_POINTS), scan.keyframe.points.all
        best, most = None, _share(sample, target, found) - _SEARCH_LOSS
        for ahead_m in np.arange(start_m, min(end_m, self._searched_m), _SEARCH_STEP_M):
            motion = found.copy()
            motion[0, 3] = ahead_m
            if not _is_apart(motion, found):
                continue
            if _share(rough, target, motion) < most - _ROUGH_LOSS:
                continue
            share = _share(sample, target, motion)
            if share > most:
                best, most = motion, share
        return best


def _steady_motion(scan: UnlocatedScan, last: LocatedScan) -> Float64:
    """Return the motion since the keyframe at the velocity since then, or, where it is too young, the last one."""
    keyframe, velocity = scan.keyframe, last.velocity
    if last.stamp_s - keyframe.stamp_s >= _MIN_STEADY_S:
        velocity = keyframe.velocity_to(last.localization, last.stamp_s)
    return keyframe.motion_to(last) @ extrapolate(velocity, scan.stamp_s - last.stamp_s)


def _is_plausible(scan: UnlocatedScan, motion: Float64, other: Float64) -> bool:
    """Return whether a motion brings hardly fewer points onto static surfaces than another."""
    sample, target = scan.points.thinned(SEARCH_POINTS), scan.keyframe.points.static
    shares = [_share(sample, target, one) for one in (motion, other)]
    return shares[0] > shares[1] - _MAX_INS_LOSS


def _surface_alignment(
    points: PreprocessedPoints, target: PreprocessedPoints, motion: Float64, carried: Float64
) -> Alignment | None:
    """Align what a motion brings onto surfaces, and once more what that brings there, unless it is the carried one."""
    found = None
    for _ in range(2):
        kept = on_surfaces(points, target, motion, SURFACE_M)
        found = accepted_alignment(target, kept, Guess(motion))
        if found is None:
            return None
        motion = found.target_SE3_source
        if not _is_apart(motion, carried):
            return None
    return found


def _share(points: PreprocessedPoints, target: PreprocessedPoints, motion: Float64) -> float:
    """Return the share of points that a motion brings onto surfaces."""
    return share_on_surfaces(points, target, motion, _TIGHT_M)


def _is_apart(motion: Float64, other: Float64) -> bool:
    """Return whether two motions are so far apart that they do not converge to the same one."""
    return length_m(motion - other) >= REACH_M / 2
