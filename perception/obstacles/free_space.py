"""Visibility of a place in earlier scans: free, hit or occluded."""

from collections import deque
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from perception.geometry import se3
from perception.localization.pose_covariance import plane_deviations_m
from perception.obstacles.range_image import (
    PointVisibility,
    RangeImage,
    SphericalProjection,
    Visibility,
)
from perception.sensor import LidarModel
from perception.types import Bool, Float32, Float64, UInt8

# Largest difference in range of two returns from one surface, and the error across the beam: range noise, a pose error of
# 5 cm and the slant of a surface within a pixel. A place tells nothing where the poses of two scans put it farther apart.
MARGIN_M = 0.2


@dataclass(frozen=True)
class VisibilityHistory:
    """Visibility of P places in the scans of the last 1.5 s or so, from the newest queried scan to the oldest.

    Attributes:
        ages_s: (A,) age of each queried scan in seconds, rising.
        states: (A, P) `Visibility` of the place; what an older scan has hit, younger ones are not asked about.
        gaps_m: (A, P) distance in metres to an uncovered place from the object that occluded it.
    """

    ages_s: Float64
    states: UInt8
    gaps_m: Float32

    @cached_property
    def persisted(self) -> Bool:
        """(P,) whether an older scan hit the place or, where none of them tells, the youngest."""
        return np.asarray(self._was_hit | (~self._was_free & (self.states[0] == Visibility.HIT)))

    @cached_property
    def appeared(self) -> Bool:
        """(P,) whether the older scans or, where none of them tells, the youngest found the place free."""
        return np.asarray(~self._was_hit & (self._was_free | (self.states[0] == Visibility.FREE)))

    @cached_property
    def uncovered(self) -> Bool:
        """(P,) whether only what was behind a departed object tells of the place."""
        was_uncovered = (self.states == Visibility.UNCOVERED).any(axis=0)
        return np.asarray(was_uncovered & ~self.appeared & ~self.persisted)

    @cached_property
    def _was_hit(self) -> Bool:
        return np.asarray((self._older == Visibility.HIT).any(axis=0))

    @cached_property
    def _was_free(self) -> Bool:
        return np.asarray((self._older == Visibility.FREE).any(axis=0))

    @property
    def _older(self) -> UInt8:
        return self.states[min(1, len(self.states) - 1) :]


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

    def is_free_in_newest(self, points_velo: Float32) -> Bool:
        """Return through which (P, 3) places in the newest scan's frame a beam of it passed."""
        free = self._scans[-1].image.are_free(points_velo, MARGIN_M)
        return free & ~self._are_doubtful(points_velo, np.zeros((6, 6)))

    def _are_doubtful(self, points_velo: Float32, covariance: Float64) -> Bool:
        """Return which (P, 3) places the poses of the newest scan and of another do not locate well enough."""
        covariance = self._scans[-1].covariance + covariance
        # Deviations grow with range: as a rule not even the farthest place is doubtful.
        if plane_deviations_m(covariance, self._reach_m)[0] < MARGIN_M:
            return np.zeros(len(points_velo), bool)
        ranges_m = np.hypot(points_velo[:, 0], points_velo[:, 1])
        return np.asarray(plane_deviations_m(covariance, ranges_m) > MARGIN_M)

    def visibility(self, points_velo: Float32, age: int) -> PointVisibility:
        """Return the visibility of (P, 3) places in the newest scan's frame, in the scan so many scans before it."""
        past = self._scans[-1 - age]
        points_past = se3.transform_points(self._past_SE3_newest(age), points_velo)
        visibility = past.image.visibility(points_past, MARGIN_M)
        visibility.states[self._are_doubtful(points_velo, past.covariance)] = Visibility.UNKNOWN
        return visibility

    def query(self, points_velo: Float32) -> VisibilityHistory:
        """Query scans of a third, two thirds and all of the horizon for (P, 3) places of the newest."""
        ages = self.queried_ages()
        states = np.zeros((len(ages), len(points_velo)), np.uint8)
        gaps_m, rows = np.zeros(states.shape, np.float32), np.arange(len(points_velo))
        for number in reversed(range(len(ages))):
            places = points_velo.take(rows, axis=0)
            visibility = self.visibility(places, ages[number])
            occluded = np.flatnonzero(visibility.states == Visibility.OCCLUDED)
            gaps_of_occluded_m = visibility.gaps_m[occluded]
            ends = self._towards_past(
                places.take(occluded, axis=0), ages[number], gaps_of_occluded_m
            )
            visibility.states[occluded[self.is_free_in_newest(ends)]] = Visibility.UNCOVERED
            states[number, rows], gaps_m[number, rows] = visibility.states, visibility.gaps_m
            rows = rows[visibility.states != Visibility.HIT]
        return VisibilityHistory(
            np.array([self.age_s(age) for age in ages], np.float64), states, gaps_m
        )

    def _towards_past(self, points_velo: Float32, age: int, by_m: Float32) -> Float32:
        """Move (P, 3) places of the newest scan towards where the sensor was in an earlier one."""
        origin = se3.inverse(self._past_SE3_newest(age))[:3, 3].astype(np.float32)
        beams = points_velo - origin
        # A third of the time of np.linalg.norm.
        ranges = np.sqrt(np.einsum("pi,pi->p", beams, beams))
        return np.asarray(points_velo - beams * (by_m / ranges)[:, None], np.float32)

    def _past_SE3_newest(self, age: int) -> Float64:
        return se3.inverse(self._scans[-1 - age].world_SE3_velo) @ self._scans[-1].world_SE3_velo

    def queried_ages(self) -> list[int]:
        """Return the ages of the queried scans, in scans, rising."""
        oldest = len(self._scans) - 1
        return sorted({round(oldest * part) for part in (1 / 3, 2 / 3, 1)} - {0})
