"""Visibility of a place in earlier scans: free, hit or occluded."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from perception.geometry import se3
from perception.localization.pose_covariance import plane_deviations_m
from perception.obstacles.range_image import RangeImage, SphericalProjection, Visibility
from perception.sensor import LidarModel
from perception.types import Bool, Float32, Float64, Int, UInt8

# Seen from farther back, a post of 10 cm at the end of the area falls between two beams.
_MAX_TRAVEL_M = 12.0
# Largest difference in range of two returns from one surface, and the error across the beam: range noise, a pose error of
# 5 cm and the slant of a surface within a pixel.
MARGIN_M = 0.2
# A place tells nothing where the poses of two scans may put it farther apart than this: a deviation, beyond the largest of
# faultless drives (0.26 m). What does not move would fill free space there.
_MAX_DEVIATION_M = 0.3


@dataclass(frozen=True)
class PastReturns:
    """Scans of the horizon in which single beams ended at P places or passed them.

    Attributes:
        left: (P,) number of scans in which a beam ended at the place that another beam passed later.
        visible: (P,) number of scans in which a beam ended at the place or passed.
    """

    left: Int
    visible: Int


@dataclass(frozen=True)
class VisibilityHistory:
    """Visibility of P places in the scans of the last 1.5 s or so, from the newest queried scan to the oldest.

    Attributes:
        ages_s: (A,) age of each queried scan in seconds, rising.
        was_free: (A, P) whether a beam passed through the place.
        was_hit: (A, P) whether a beam ended at the place.
        was_behind_departed: (A, P) whether the place was occluded by an object that has left since.
        gaps_m: (A, P) distance in metres from that object to the place.
        past_returns: Function that counts all scans of the horizon, for some of the places.
    """

    ages_s: Float64
    was_free: Bool
    was_hit: Bool
    was_behind_departed: Bool
    gaps_m: Float32
    past_returns: Callable[[Int], PastReturns]


@dataclass(frozen=True)
class _PastScan:
    """A scan of the horizon.

    Attributes:
        image: Its range image.
        world_SE3_velo: (4, 4) pose of the scan.
        covariance: (6, 6) covariance of the pose.
        stamp_s: Time of the scan in seconds.
    """

    image: RangeImage
    world_SE3_velo: Float64
    covariance: Float64
    stamp_s: float


class FreeSpaceMemory:
    """Range images of the newest scan and of those before it, with their poses."""

    def __init__(self, sensor: LidarModel, horizon_s: float, reach_m: float = 1e4) -> None:
        """Start without a scan.

        Args:
            sensor: LiDAR model of the scans.
            horizon_s: Age of the oldest queried scan in seconds.
            reach_m: Distance over the ground plane within which all places are; else that of any return.
        """
        self._projection = SphericalProjection(sensor, tolerance_m=MARGIN_M / 2)
        self._reach_m = np.array([reach_m])
        self._max_age_s = horizon_s + 0.5 / sensor.rate_hz  # stamps jitter
        self._scans: deque[_PastScan] = deque()

    def push(
        self,
        points_velo: Float32,
        world_SE3_velo: Float64,
        stamp_s: float,
        covariance: Float64 | None = None,
    ) -> None:
        """Add the newest scan, its pose of a (6, 6) covariance or exact; those beyond the horizon drop out but the last."""
        image = RangeImage(points_velo, self._projection)
        covariance = np.zeros((6, 6)) if covariance is None else covariance
        self._scans.append(_PastScan(image, world_SE3_velo, covariance, stamp_s))
        while len(self._scans) > 2 and self.age_s(len(self._scans) - 1) > self._max_age_s:
            self._scans.popleft()

    def age_s(self, age: int) -> float:
        """Return the age in seconds of the scan so many scans before the newest."""
        # The last bits are those of the time that stamps are counted from.
        return round(self._scans[-1].stamp_s - self._scans[-1 - age].stamp_s, 6)

    def clear(self) -> None:
        """Forget all scans."""
        self._scans.clear()

    def mark_moving(self, moving_velo: Float32) -> None:
        """Remember that these (M, 3) returns of the newest scan are of what moves."""
        self._scans[-1].image.mark_moving(moving_velo)

    def is_free_in_newest(self, points_velo: Float32) -> Bool:
        """Return through which (P, 3) places in the newest scan's frame a beam of it passed."""
        free = self._scans[-1].image.are_free(points_velo, MARGIN_M)
        return free & ~self._are_doubtful(points_velo, np.zeros((6, 6)))

    def _are_doubtful(self, points_velo: Float32, covariance: Float64) -> Bool:
        """Return which (P, 3) places the poses of the newest scan and of another do not locate well enough."""
        covariance = self._scans[-1].covariance + covariance
        # Deviations grow with range: as a rule not even the farthest place is doubtful.
        if plane_deviations_m(covariance, self._reach_m)[0] < _MAX_DEVIATION_M:
            return np.zeros(len(points_velo), bool)
        ranges_m = np.hypot(points_velo[:, 0], points_velo[:, 1])
        return np.asarray(plane_deviations_m(covariance, ranges_m) > _MAX_DEVIATION_M)

    def states(self, points_velo: Float32, age: int) -> UInt8:
        """Return the (P,) `Visibility` of (P, 3) places in the newest scan's frame, in the scan so many scans before it."""
        past = self._scans[-1 - age]
        points_past = se3.transform_points(self._past_SE3_newest(age), points_velo)
        states = past.image.visibility(points_past, MARGIN_M).states
        states[self._are_doubtful(points_velo, past.covariance)] = Visibility.UNKNOWN
        return states

    def query(self, points_velo: Float32) -> VisibilityHistory:
        """Query scans of a third, two thirds and all of the horizon for (P, 3) places of the newest."""
        ages = self.queried_ages()
        shape = (len(ages), len(points_velo))
        was_free, was_hit, was_behind_departed = (np.zeros(shape, bool) for _ in range(3))
        gaps_m = np.zeros(shape, np.float32)
        for row, age in enumerate(ages):
            past, past_SE3_newest = self._scans[-1 - age], self._past_SE3_newest(age)
            points_past = se3.transform_points(past_SE3_newest, points_velo)
            visibility = past.image.visibility(points_past, MARGIN_M)
            was_free[row] = visibility.states == Visibility.FREE
            was_hit[row] = visibility.states == Visibility.HIT
            gaps_m[row] = visibility.gaps_m
            occluded = np.flatnonzero(visibility.states == Visibility.OCCLUDED)
            ends = _shorten(points_past[occluded], visibility.gaps_m[occluded])
            ends_now = se3.transform_points(se3.inverse(past_SE3_newest), ends)
            was_behind_departed[row, occluded] = self.is_free_in_newest(ends_now)
            is_doubtful = self._are_doubtful(points_velo, past.covariance)
            for states in (was_free, was_behind_departed):
                states[row] &= ~is_doubtful
        return VisibilityHistory(
            np.array([self.age_s(age) for age in ages], np.float64),
            was_free,
            was_hit,
            was_behind_departed,
            gaps_m,
            lambda rows: self._past_returns(points_velo[rows]),
        )

    def _past_returns(self, points_velo: Float32) -> PastReturns:
        """Count all scans of the horizon by what they saw at (P, 3) places of the newest, the youngest first."""
        left, visible = np.zeros((2, len(points_velo)), np.int64)
        was_empty = np.zeros(len(points_velo), bool)
        for age in range(1, self._oldest_age() + 1):
            scan = self._scans[-1 - age]
            points_past = se3.transform_points(self._past_SE3_newest(age), points_velo)
            ends, passes = scan.image.returns(points_past, MARGIN_M)
            left += ends & was_empty
            visible += ends | passes
            was_empty |= passes & ~ends
        return PastReturns(left, visible)

    def _past_SE3_newest(self, age: int) -> Float64:
        return se3.inverse(self._scans[-1 - age].world_SE3_velo) @ self._scans[-1].world_SE3_velo

    def queried_ages(self) -> list[int]:
        """Return the ages of the queried scans, in scans, rising."""
        oldest = self._oldest_age()
        return sorted({round(oldest * part) for part in (1 / 3, 2 / 3, 1)} - {0})

    def _oldest_age(self) -> int:
        """Return the age of the oldest scan that is queried, in scans."""
        here = self._scans[-1].world_SE3_velo[:3, 3].tolist()
        usable = [
            age
            for age, scan in enumerate(reversed(self._scans))
            if math.dist(scan.world_SE3_velo[:3, 3].tolist(), here) <= _MAX_TRAVEL_M
        ]
        # At a speed beyond the limit, the scan before is still the best one.
        return min(max(usable[-1], 1), len(self._scans) - 1)


def _shorten(points: Float32, by_m: Float32) -> Float32:
    """Move (P, 3) points towards the origin."""
    ranges = np.sqrt(np.einsum("pi,pi->p", points, points))  # a third of the time of np.linalg.norm
    return np.asarray(points * (1 - by_m / ranges)[:, None], np.float32)
