"""Bodies that move as a whole although most of their surface fills the place that it filled before.

A lorry that creeps along its own axis leaves the beams to its smooth side unchanged: only its ends appear and depart.
So a cluster in which something appeared is moved back along its axis, by every distance that it may have come since
the oldest queried scan. It moves where one of these explains that scan better than a static body does, and where its
front appeared or its rear has left free space: a wall beside a pedestrian has no such end.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from perception.obstacles.config import RigidBodyConfig
from perception.obstacles.free_space import FreeSpaceMemory
from perception.obstacles.range_image import Visibility
from perception.types import Bool, Float32, Int, UInt8

Rows = TypeVar("Rows", Int, Float32)
_HEADINGS_RAD = np.radians(np.arange(0.0, 90.0, 1.5))
_OUTLINE_POINTS, _FAR_INSIDE_M = 150, 0.3


@dataclass(frozen=True)
class _Body:
    """A cluster along one direction of one of its axes.

    Attributes:
        rows: (B,) its voxels within the width of what appeared.
        axis: (3,) direction of motion.
        front: (F,) some of the voxels at the front.
        rear: (R,) some of the voxels at the rear.
        sides: (S,) some of all voxels.
    """

    rows: Int
    axis: Float32
    front: Int
    rear: Int
    sides: Int

    @property
    def samples(self) -> Int:
        """(F + R + S,) all voxels that are compared."""
        return np.concatenate([self.front, self.rear, self.sides])


@dataclass(frozen=True)
class OccupiedPlaces:
    """V occupied voxels of the newest scan.

    Attributes:
        places_m: (V, 3) their positions in the LiDAR frame.
        clusters: (V,) cluster of each, 0 for none.
        is_new: (V,) whether the place was not occupied before.
        moves: (V,) whether it is known to move.
    """

    places_m: Float32
    clusters: Int
    is_new: Bool
    moves: Bool


def moving_bodies(
    occupied: OccupiedPlaces, memory: FreeSpaceMemory, age_s: float, config: RigidBodyConfig
) -> Bool:
    """Return which of V occupied voxels belong to bodies that move along one of their axes.

    Args:
        occupied: Occupied voxels of the newest scan.
        memory: Earlier scans.
        age_s: Age of the oldest queried scan in seconds.
        config: Thresholds of rigid bodies.
    """
    moves = np.zeros(len(occupied.moves), bool)
    bodies = _bodies(occupied, config)
    farthest_m = min(config.max_distance_m, config.max_speed_m_s * age_s)
    distances_m = np.append(
        0.0, np.arange(config.min_distance_m, farthest_m, config.step_m)
    ).astype(np.float32)
    if not bodies:
        return moves
    moved = [
        _moved_back(occupied.places_m[body.samples], body.axis, distances_m) for body in bodies
    ]
    states = memory.states_in_oldest(np.concatenate(moved))
    starts = np.cumsum([0, *(len(part) for part in moved)])
    for body, start, stop in zip(bodies, starts[:-1], starts[1:], strict=True):
        seen = states[start:stop].reshape(len(distances_m), -1)
        best = _best_distance(seen, config)
        if best and _has_an_end(body, seen[best], distances_m[best], occupied, memory, config):
            moves[body.rows] = True
    return moves


def _bodies(occupied: OccupiedPlaces, config: RigidBodyConfig) -> list[_Body]:
    """Return the clusters in which enough is new, along both directions of each of their axes."""
    clusters = occupied.clusters
    new, rest = np.bincount(clusters, occupied.is_new), np.bincount(clusters, ~occupied.moves)
    is_large = np.bincount(clusters) >= config.min_body_voxels
    is_candidate = is_large & (new >= config.min_voxels) & (rest >= config.min_voxels)
    is_candidate[0] = False
    order = np.argsort(clusters, kind="stable")
    starts = np.searchsorted(clusters[order], np.arange(len(new) + 1))
    bodies = []
    for number in np.flatnonzero(is_candidate):
        rows = order[starts[number] : starts[number + 1]]
        heading_rad, length_m = _longer_axis(occupied.places_m[rows, :2])
        if not config.min_length_m <= length_m <= config.max_length_m:
            continue
        turns = 2 if length_m > config.long_m else 4
        for turn_rad in np.pi / 2 * np.array([0, 2, 1, 3])[:turns]:
            bodies.append(_body(occupied, rows, heading_rad + turn_rad, config))
    return bodies


def _body(
    occupied: OccupiedPlaces, rows: Int, heading_rad: float, config: RigidBodyConfig
) -> _Body:
    axis = np.array([np.cos(heading_rad), np.sin(heading_rad), 0.0], np.float32)
    left_m = occupied.places_m[rows] @ np.array([-axis[1], axis[0], 0.0], np.float32)
    low_m, high_m = np.quantile(left_m[occupied.is_new[rows]], (0.05, 0.95))
    margin_m = config.side_margin_m
    rows = rows[(left_m > low_m - margin_m) & (left_m < high_m + margin_m)]
    along_m = occupied.places_m[rows] @ axis
    front = rows[along_m > along_m.max() - config.end_m]
    rear = rows[along_m < along_m.min() + config.end_m]
    count = config.samples
    return _Body(rows, axis, _thinned(front, count), _thinned(rear, count), _thinned(rows, count))


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


def _moved_back(places_m: Float32, axis: Float32, distances_m: Float32) -> Float32:
    """Return (D * S, 3) places moved back by each of D distances."""
    return np.asarray(places_m - distances_m[:, None, None] * axis, np.float32).reshape(-1, 3)


def _best_distance(states: UInt8, config: RigidBodyConfig) -> int:
    """Return the row of the distance that explains the earlier scan, 0 where the body may be static.

    Args:
        states: (D, S) visibility of the samples in that scan, moved back by each distance; the first is 0.
        config: Thresholds.
    """
    hits = (states == Visibility.HIT).sum(axis=1)
    free = (states == Visibility.FREE).sum(axis=1)
    known = (states != Visibility.UNKNOWN).sum(axis=1)
    explained = hits / np.maximum(known, 1)
    fits = hits >= config.min_explained_ratio * (hits + free)
    best = int(np.argmax(np.where(fits, explained, -1.0)))
    gains = explained[best] - explained[0] >= config.min_gain_ratio
    return best if fits[best] and gains else 0


def _has_an_end(
    body: _Body,
    states: UInt8,
    distance_m: float,
    occupied: OccupiedPlaces,
    memory: FreeSpaceMemory,
    config: RigidBodyConfig,
) -> bool:
    """Return whether the front appeared where it was not, or the rear has left where it was.

    Args:
        body: Body.
        states: Visibility of its samples in the earlier scan, moved back by the distance.
        distance_m: Distance in metres.
        occupied: All voxels.
        memory: Earlier scans.
        config: Thresholds.
    """
    is_hit = states == Visibility.HIT
    places_m, axis = occupied.places_m, body.axis
    ahead_m = places_m[body.front] @ axis
    is_first = ahead_m > ahead_m.max() - distance_m
    came = (is_hit[: len(body.front)] & occupied.is_new[body.front])[is_first]
    if len(came) >= config.min_end_voxels and came.mean() > config.min_end_ratio:
        return True
    behind_m = places_m[body.rear] @ axis
    is_last = behind_m < behind_m.min() + distance_m
    stop = len(body.front) + len(body.rear)
    left = is_hit[len(body.front) : stop] & memory.is_free_in_newest(
        _moved_back(places_m[body.rear], axis, np.array([distance_m], np.float32))
    )
    left = left[is_last]
    return bool(len(left) >= config.min_end_voxels and left.mean() > config.min_end_ratio)
