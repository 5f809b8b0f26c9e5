"""Bodies that move as a whole although most of their surface fills the place that it filled before.

A lorry that creeps along its own axis leaves the beams to its smooth side unchanged: only its ends come and leave. So a
cluster is moved back along its axis by every distance that it may have come since each queried scan, and its motions are
compared with rest by their posterior odds, as the page of the method states them. A vehicle that halts is one that moved
until a queried scan and rests since.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from perception.geometry.grids import LocalArea
from perception.geometry.sorting import sorted_keys
from perception.kernels.bodies import displacement_evidence
from perception.kernels.columns import count_in_groups
from perception.obstacles.free_space import MARGIN_M, FreeSpaceMemory
from perception.obstacles.range_image import Visibility
from perception.types import Bool, Float32, Float64, Int, UInt8

Rows = TypeVar("Rows", Int, Float32)
_HEADINGS_RAD = np.radians(np.arange(0.0, 90.0, 1.5))
_OUTLINE_POINTS, _FAR_INSIDE_M = 150, 0.3
_SAMPLES = 16  # voxels of each end and of the whole body

_MIN_VOXELS = 30  # of a body; of these, so many are new or moved before
_MIN_NEW_VOXELS = 10
# Of a cluster wider than a lorry with its mirrors, only what is in line with what is new is a body. Along its shorter axis
# only what is no longer than that is one.
_MAX_WIDTH_M = 3.2
_END_M = 0.7  # of a body, from which as many samples are taken as from all of it

_STEP_M = 0.3  # of distances: less than the margins of a hit on both sides
_MAX_DISTANCE_M = 8.0  # since the oldest queried scan; what came farther has left its place
_MAX_CHANGE = 0.6  # of the mean speed since a scan from that since the oldest
_LOG_ODDS = 0.5  # of a sample: neighbours err together
_PRIOR = 6.0  # log odds of rest, of what has not moved before
_RARITY = 4.0  # power of the distance by which motions are rarer
_MOVES_FOR_S = 5.0  # mean time from a start to a stop


@dataclass(frozen=True)
class OccupiedPlaces:
    """V occupied voxels of the newest scan.

    Attributes:
        places_m: (V, 3) their positions in the LiDAR frame.
        clusters: (V,) cluster of each, 0 for none.
        is_new: (V,) whether no scan had a return from the place, not even the youngest.
        was_moving: (V,) whether something that moved in the scan before is near.
        moves: (V,) whether it is known to move.
        area: Local area that holds them all.
    """

    places_m: Float32
    clusters: Int
    is_new: Bool
    was_moving: Bool
    moves: Bool
    area: LocalArea


@dataclass(frozen=True)
class _Body:
    """A cluster along one of its axes.

    Attributes:
        rows: (B,) its voxels within the width of what appeared.
        axis: (3,) direction of motion, to either side.
        samples: (S,) some of the voxels.
        moved_before: Share of its voxels that moved in the scan before.
    """

    rows: Int
    axis: Float32
    samples: Int
    moved_before: float


@dataclass(frozen=True)
class _Paths:
    """The ways on which a body may have come.

    Attributes:
        ages_s: Ages of the queried scans, rising.
        distances_m: (D,) distances since each of them, from -d to d.
        fits: (O, Y) for all scans but the oldest: whether each distance since the scan lies on the way of each one since the
            oldest. What is too slow for a step since the youngest lies on none.
    """

    ages_s: list[float]
    distances_m: list[Float32]
    fits: list[Bool]

    @classmethod
    def since(cls, ages_s: list[float]) -> "_Paths":
        """Return the ways since scans of some ages."""
        ahead_m = [
            _STEP_M * np.arange(1, np.ceil(_MAX_DISTANCE_M * age_s / ages_s[-1] / _STEP_M) + 1)
            for age_s in ages_s
        ]
        fits = []
        for age_s, came_m in zip(ages_s[:-1], ahead_m[:-1], strict=True):
            change = np.abs(came_m / (ahead_m[-1][:, None] * age_s / ages_s[-1]) - 1)
            fits.append(change <= _MAX_CHANGE)
        distances_m = [np.concatenate([-one[::-1], [0], one]).astype(np.float32) for one in ahead_m]
        return cls(ages_s, distances_m, fits)

    def log_odds(self, evidence: list[Float64], moved_before: float, interval_s: float) -> float:
        """Return the log odds that a body moves now.

        Args:
            evidence: (D,) log ratio of each distance since each queried scan to none.
            moved_before: Share of its voxels that moved in the scan before.
            interval_s: Time since the scan before.
        """
        rarity = _RARITY * np.log1p(np.arange(1, len(evidence[-1]) // 2 + 1))
        moves, stopped = -np.inf, 0.0
        for side in (1, -1):
            came = [one[::side][len(one) // 2 + 1 :] for one in evidence]
            log_ratio = came[-1] - rarity
            # From the second oldest scan to the youngest: until this one it moved, if it rests since.
            for row in range(len(self.fits) - 1, -1, -1):
                stopped = max(stopped, log_ratio.max() - _log_odds_of_going_on(self.ages_s[row]))
                log_ratio = log_ratio + np.where(self.fits[row], came[row], -np.inf).max(axis=1)
            moves = max(moves, log_ratio.max())
        goes_on = np.exp(-interval_s / _MOVES_FOR_S)
        probability = moved_before * goes_on + (1 - moved_before) * np.exp(-_PRIOR)
        prior = np.log(probability / (1 - probability))
        return float(moves + prior - max(0.0, stopped + prior))


def _log_odds_of_going_on(time_s: float) -> float:
    """Return the log odds that what moved still moves after a time."""
    return -float(np.log(np.expm1(time_s / _MOVES_FOR_S)))


def moving_bodies(occupied: OccupiedPlaces, memory: FreeSpaceMemory) -> Bool:
    """Return which of V occupied voxels belong to bodies that move along one of their axes."""
    moves = np.zeros(len(occupied.moves), bool)
    ages = memory.queried_ages()
    ages_s = [memory.age_s(age) for age in ages]
    bodies = _bodies(occupied) if ages_s and ages_s[0] > 0 else []
    if not bodies:
        return moves
    paths = _Paths.since(ages_s)
    then = [
        _states(occupied, bodies, memory, age, distances_m)
        for age, distances_m in zip(ages, paths.distances_m, strict=True)
    ]
    now = _states(occupied, bodies, memory, 0, paths.distances_m[-1])
    for number, body in enumerate(bodies):
        along_m = occupied.places_m[body.samples] @ body.axis
        low_m, high_m = _ends(occupied, body, along_m, now[number])
        evidence = []
        for states, distances_m in zip(then, paths.distances_m, strict=True):
            beyond = (len(now[number]) - len(distances_m)) // 2
            shown = now[number][beyond : len(now[number]) - beyond]
            gains = displacement_evidence(
                states[number], shown, along_m, distances_m, low_m, high_m, MARGIN_M
            )
            evidence.append(_LOG_ODDS * gains)
        if paths.log_odds(evidence, body.moved_before, memory.age_s(1)) > 0:
            moves[body.rows] = True
    return moves


def _states(
    occupied: OccupiedPlaces,
    bodies: list[_Body],
    memory: FreeSpaceMemory,
    age: int,
    distances_m: Float32,
) -> list[UInt8]:
    """Return the (D, S) visibility of the samples of each body in a scan, moved back by each of D distances."""
    moved = [
        (occupied.places_m[body.samples] - distances_m[:, None, None] * body.axis).reshape(-1, 3)
        for body in bodies
    ]
    ends = np.cumsum([len(one) for one in moved])[:-1]
    states = np.split(memory.states(np.concatenate(moved), age), ends)
    return [one.reshape(len(distances_m), -1) for one in states]


def _ends(
    occupied: OccupiedPlaces, body: _Body, along_m: Float32, now: UInt8
) -> tuple[float, float]:
    """Return where a body ends to either side; an end that the area cuts off or that something hides is infinitely far."""
    ends = {}
    for side, end_m in ((-1, along_m.min()), (1, along_m.max())):
        tip = np.flatnonzero(np.abs(along_m - end_m) < _STEP_M)
        beyond = occupied.places_m[body.samples[tip]] + side * _STEP_M * body.axis
        is_hidden = now[len(now) // 2 - 2 * side, tip] == Visibility.OCCLUDED
        is_open = np.mean(occupied.area.contains_xy(beyond) & ~is_hidden) > 0.5
        ends[side] = float(end_m) if is_open else side * np.inf
    return ends[-1], ends[1]


def _bodies(occupied: OccupiedPlaces) -> list[_Body]:
    """Return the clusters in which enough is new, along each axis along which they may move."""
    clusters = occupied.clusters
    sizes = np.bincount(clusters)
    new, rest, was_moving = (
        count_in_groups(clusters, np.ascontiguousarray(voxels), len(sizes))
        for voxels in (occupied.is_new, ~occupied.moves, occupied.was_moving)
    )
    may_move = np.maximum(new, was_moving) >= _MIN_NEW_VOXELS
    is_candidate = (sizes >= _MIN_VOXELS) & may_move & (rest >= _MIN_NEW_VOXELS)
    is_candidate[0] = False
    _, order = sorted_keys(clusters)
    starts = np.cumsum([0, *sizes])
    bodies = []
    for number in np.flatnonzero(is_candidate):
        rows = order[starts[number] : starts[number + 1]]
        heading_rad, length_m = _longer_axis(occupied.places_m[rows, :2])
        for turn_rad in np.pi / 2 * np.arange(1 if length_m > _MAX_WIDTH_M else 2):
            bodies.append(_body(occupied, rows, heading_rad + turn_rad))
    return bodies


def _body(occupied: OccupiedPlaces, rows: Int, heading_rad: float) -> _Body:
    """Return the part of a cluster that may be a body: all of it if it is as wide as a vehicle, else what is in line."""
    axis = np.array([np.cos(heading_rad), np.sin(heading_rad), 0.0], np.float32)
    left_m = occupied.places_m[rows] @ np.array([-axis[1], axis[0], 0.0], np.float32)
    if np.ptp(left_m) > _MAX_WIDTH_M:
        in_line = occupied.is_new[rows] | occupied.was_moving[rows]
        low_m, high_m = np.quantile(left_m[in_line], (0.05, 0.95))
        rows = rows[(left_m > low_m) & (left_m < high_m)]
    along_m = occupied.places_m[rows] @ axis
    parts = rows[along_m > along_m.max() - _END_M], rows[along_m < along_m.min() + _END_M], rows
    samples = np.concatenate([_thinned(part, _SAMPLES) for part in parts])
    return _Body(rows, axis, samples, float(occupied.was_moving[rows].mean()))


def _longer_axis(places_m: Float32) -> tuple[float, float]:
    """Return the heading of the longer side of an outline, and its length.

    Of all rectangles around the outline it is the one whose sides its points are closest to: the smallest rectangle
    around one side and one end of a body may lie along the diagonal.
    """
    x_m, y_m = _thinned(places_m, _OUTLINE_POINTS).T
    cos, sin = np.cos(_HEADINGS_RAD)[:, None], np.sin(_HEADINGS_RAD)[:, None]
    along_m = np.stack([cos * x_m + sin * y_m, cos * y_m - sin * x_m])
    low_m, high_m = along_m.min(axis=2, keepdims=True), along_m.max(axis=2, keepdims=True)
    away_m = np.minimum(along_m - low_m, high_m - along_m).min(axis=0)
    best = int(np.argmin(np.minimum(away_m, _FAR_INSIDE_M).sum(axis=1)))
    sides_m = (high_m - low_m)[:, best, 0]
    heading_rad = float(_HEADINGS_RAD[best])
    return heading_rad + (np.pi / 2 if sides_m[1] > sides_m[0] else 0.0), float(sides_m.max())


def _thinned(rows: Rows, count: int) -> Rows:
    return rows[:: max(1, -(-len(rows) // count))]
