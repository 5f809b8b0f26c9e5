"""Bodies that move as a whole although most of their surface fills the place that it filled before.

A lorry that creeps along its own axis leaves the beams to its smooth side unchanged: only its ends come and leave. So a
cluster is moved back along its axis by every distance that it may have come since each queried scan, and its motions are
compared with rest by their posterior odds, as the page of the method states them. A vehicle that halts is one that moved
until a queried scan and rests since.
"""

from dataclasses import dataclass

import numpy as np

from perception.geometry.grids import LocalArea
from perception.geometry.sorting import sorted_keys
from perception.kernels.bodies import displacement_evidence, longer_axis
from perception.kernels.columns import count_in_groups
from perception.obstacles.free_space import MARGIN_M, FreeSpaceMemory
from perception.obstacles.range_image import Visibility
from perception.types import Bool, Float32, Float64, Int, UInt8

_OUTLINE_PLACES = 150  # voxels that its outline is fitted to
_SAMPLES = 16  # voxels of each end and of the whole body

_MIN_VOXELS = 30  # of a body; of these, so many are new or moved before
_MIN_NEW_VOXELS = 10
_MAX_WIDTH_M = 3.2  # of a lorry with its mirrors
_END_M = 0.7  # of a body, from which as many samples are taken as from all of it

_STEP_M = 0.3  # of distances: less than the margins of a hit on both sides
_MAX_DISTANCE_M = 8.0  # since the oldest queried scan; what came farther has left its place
_MAX_CHANGE = 0.6  # of the mean speed since a scan from that since the oldest
_LOG_ODDS = 0.5  # of a sample: neighbours err together
_PRIOR = 4.0  # log odds of rest, of what has not moved before, and power of the distance by which motions are rarer
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
        rarity = _PRIOR * np.log1p(np.arange(1, len(evidence[-1]) // 2 + 1))
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
    states = [
        _states(occupied, bodies, memory, age, distances_m)
        for age, distances_m in zip(
            [*ages, 0], [*paths.distances_m, paths.distances_m[-1]], strict=True
        )
    ]
    for body, (*then, now) in zip(bodies, zip(*states, strict=True), strict=True):
        along_m = occupied.places_m[body.samples] @ body.axis
        low_m, high_m = _ends(occupied, body, along_m, now)
        evidence = []
        for of_scan, distances_m in zip(then, paths.distances_m, strict=True):
            beyond = (len(now) - len(distances_m)) // 2
            shown = now[beyond : len(now) - beyond]
            gains = displacement_evidence(
                of_scan, shown, along_m, distances_m, low_m, high_m, MARGIN_M
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
    sizes = [len(body.samples) for body in bodies]
    samples = occupied.places_m.take(np.concatenate([body.samples for body in bodies]), axis=0)
    axes = np.repeat([body.axis for body in bodies], sizes, axis=0)
    moved = samples - distances_m[:, None, None] * axes
    states = memory.visibility(moved.reshape(-1, 3), age).states.reshape(len(distances_m), -1)
    return [np.ascontiguousarray(one) for one in np.split(states, np.cumsum(sizes)[:-1], axis=1)]


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
        outline_m = occupied.places_m[_thinned(rows, _OUTLINE_PLACES), :2]
        heading_rad, length_m = longer_axis(np.ascontiguousarray(outline_m))
        for turn_rad in np.pi / 2 * np.arange(1 if length_m > _MAX_WIDTH_M else 2):
            bodies.append(_body(occupied, rows, heading_rad + turn_rad))
    return bodies


def _body(occupied: OccupiedPlaces, rows: Int, heading_rad: float) -> _Body:
    """Return the part of a cluster that may be a body: all of it if it is as wide as a vehicle, else what is in line.

    In line with what is new; along its shorter axis only what is no longer than that is a body.
    """
    axis = np.array([np.cos(heading_rad), np.sin(heading_rad), 0.0], np.float32)
    left_m = occupied.places_m[rows] @ np.array([-axis[1], axis[0], 0.0], np.float32)
    if np.ptp(left_m) > _MAX_WIDTH_M:
        in_line = occupied.is_new[rows] | occupied.was_moving[rows]
        ordered_m = np.sort(left_m[in_line])
        low_m, high_m = ordered_m[len(ordered_m) // 20], ordered_m[-1 - len(ordered_m) // 20]
        rows = rows[(left_m > low_m) & (left_m < high_m)]
    along_m = occupied.places_m[rows] @ axis
    parts = rows[along_m > along_m.max() - _END_M], rows[along_m < along_m.min() + _END_M], rows
    samples = np.concatenate([_thinned(part, _SAMPLES) for part in parts])
    return _Body(rows, axis, samples, float(occupied.was_moving[rows].mean()))


def _thinned(rows: Int, count: int) -> Int:
    return rows[:: max(1, -(-len(rows) // count))]
