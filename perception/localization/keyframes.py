"""Keyframes: the scans that later ones are matched with."""

from collections import deque

import numpy as np

from perception.geometry.se3 import rotation_angle_rad
from perception.localization.alignment import PreprocessedPoints
from perception.localization.elevation_bias import ElevationBias
from perception.localization.located_scan import LocatedScan, PoseOrigin
from perception.localization.motion_search import length_m
from perception.types import Float64

# A keyframe is replaced after this way or turn, or where fewer points match. Over the shorter way, what is static is told
# from vehicles that creep along.
_KEYFRAME_M, _KEYFRAME_RAD, _KEYFRAME_INLIER_RATIO = 5.0, float(np.radians(15)), 0.6
MIN_KEYFRAME_M = 1.0
# A scan is matched with the last keyframes together: few beams see other rings of a surface from each place.
# More of them where much moves, as what stands between vehicles is seen from few places, and where scans are far apart: at
# 1 Hz rotations of a step are 5 to 10 % nearer to the truth with them, at 2 Hz and more they are not.
_KEYFRAMES, _MORE_KEYFRAMES, _FAR_APART_S = 3, 5, 0.7


class Keyframes:
    """The last keyframes, of which the newest is at most a few metres back.

    Attributes:
        newest: The newest keyframe.
    """

    newest: LocatedScan

    def __init__(self, elevation: ElevationBias) -> None:
        """Start without a keyframe.

        Args:
            elevation: Bias of the elevations, which pairs of keyframes tell.
        """
        self._elevation = elevation
        self._kept: deque[LocatedScan] = deque(maxlen=_MORE_KEYFRAMES)
        self._since: deque[LocatedScan] = deque(maxlen=16)  # the newest and some later scans
        # Made at the next scan, when it is known what moves.
        self._surroundings: PreprocessedPoints | None = None

    def surroundings(self, gap_s: float) -> PreprocessedPoints:
        """Return the static points of the last keyframes in the frame of the newest.

        Args:
            gap_s: Time between the last two scans in seconds.
        """
        if self._surroundings is None:
            newest = self.newest
            are_more = newest.points.is_crowded or gap_s > _FAR_APART_S
            count = _MORE_KEYFRAMES if are_more else _KEYFRAMES
            others = [one for one in self._kept if one is not newest][1 - count :]
            self._surroundings = newest.points.joined(
                [(one.points, newest.motion_to(one)) for one in others]
            )
        return self._surroundings

    def replace_newest(self, scan: LocatedScan) -> None:
        """Make a scan the newest keyframe."""
        if scan.localization.origin is not PoseOrigin.REGISTERED or scan.localization.is_reset:
            self._kept.clear()  # where they are from here is not known well enough
        self.newest, self._surroundings = scan, None
        self._kept.append(scan)
        self._since.clear()
        self._since.append(scan)

    def forget_moving(self) -> None:
        """Keep the newest alone, and all of its points, where the poses that told what moves were wrong."""
        self.newest.points.forget_moving()
        self._kept.clear()
        self._surroundings = self.newest.points.all

    def update(self, scan: LocatedScan, last: LocatedScan) -> None:
        """Replace the newest where it is too far back, by a scan that is far enough back.

        Args:
            scan: The scan that was located.
            last: The one before it.
        """
        origin = scan.localization.origin
        if origin is PoseOrigin.EXTRAPOLATED and not scan.localization.is_reset:
            return
        moved = self.newest.motion_to(scan)
        turns = rotation_angle_rad(moved) > _KEYFRAME_RAD
        if turns or origin is not PoseOrigin.REGISTERED:
            self.replace_newest(scan)
            return
        if length_m(self._since[-1].motion_to(scan)) >= MIN_KEYFRAME_M / 2:
            self._since.append(scan)
        is_worn = scan.localization.inlier_ratio < _KEYFRAME_INLIER_RATIO
        is_passed = length_m(moved) > _KEYFRAME_M
        has_ins = scan.ins_world_SE3_velo is not None
        if is_passed and not has_ins and self._correct_elevations(scan, moved):
            return
        if is_worn or is_passed:
            step_m = length_m(last.motion_to(scan))
            for earlier in reversed(self._since):
                is_far = length_m(earlier.motion_to(scan)) + step_m >= MIN_KEYFRAME_M
                if is_far and earlier is not self.newest:
                    self.replace_newest(earlier)
                    return

    def _correct_elevations(self, scan: LocatedScan, moved: Float64) -> bool:
        """Take the pair of a scan and the keyframe; where it proves a bias, raise all points so far."""
        more_rad = self._elevation.update(self.newest.points.static, scan.points.all, moved)
        if more_rad == 0:
            return False
        self.replace_newest(scan)
        for one in self._kept:
            one.points.raise_beams(more_rad)
        return True
