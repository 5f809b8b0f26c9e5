"""Bodies that move as a whole although most of their surface fills the place that it filled before.

A lorry that creeps along its own axis leaves the beams to its smooth side unchanged: only its ends appear and depart.
So a cluster in which something appeared is moved back along its axis, by every distance that it may have come since
the oldest queried scan. It moves where one of these explains that scan better than a static body does, and where its
front appeared or its rear has left free space: a wall beside a pedestrian has no such end. What moved in the scan before
goes on without one. Where no front can be seen, the area cuts it off or something hides it, the rear must have left free
space at a steady speed. It has stopped where a younger scan has hit its ends where they are.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from perception.geometry.grids import LocalArea
from perception.geometry.sorting import sorted_keys
from perception.kernels.columns import count_in_groups
from perception.obstacles.free_space import FreeSpaceMemory
from perception.obstacles.range_image import Visibility
from perception.types import Bool, Float32, Int, UInt8

Rows = TypeVar("Rows", Int, Float32)
_HEADINGS_RAD = np.radians(np.arange(0.0, 90.0, 1.5))
_OUTLINE_POINTS, _FAR_INSIDE_M = 150, 0.3
_MIN_AGES = 2  # of scans that tell how a body came, beside the newest
_EDGE_M = 0.3  # from the edge of the area, within which an end is cut off

# Size of a body. Smaller ones than 100 voxels leave their place soon; a lorry's rear is 2 m wide, a tram of two parts
# 22 m long, a lorry with its mirrors 3.2 m wide. Of a wider cluster, only what is in line with what is new is a body.
_MIN_VOXELS, _MIN_NEW_VOXELS = 100, 10
_MIN_LENGTH_M, _MAX_LENGTH_M, _MAX_WIDTH_M = 2.0, 24.0, 3.2
_LONG_M = 5.0  # length from which on a body moves along its longer axis only
_SIDE_MARGIN_M = 0.3  # beside what is new in a wider cluster
# A thinner body than this, or one longer than ten times its width, may be a fence, and must hide what is behind it.
MIN_WIDTH_M, MAX_LENGTH_PER_WIDTH, _MIN_HIDDEN_RATIO = 0.5, 10.0, 0.5

# Distances that it may have come since the oldest queried scan. What came less than 0.3 m, almost twice the margin of a
# hit, is hit where it is in either case; what came farther than 8 m left its place. Steps are within the margin of a
# hit on both sides. While the history is short, the speed is the limit.
_MIN_DISTANCE_M, _MAX_DISTANCE_M, _STEP_M, _MAX_SPEED_M_S = 0.3, 8.0, 0.3, 30.0
# Speeds since the younger queried scans that are tried, as shares of the mean speed since the oldest.
_SPEEDS_ON_THE_WAY = np.arange(0.4, 1.7, 0.1)
_SAMPLES = 24  # largest number of voxels that are compared, of each end and of the whole body
_MIN_EXPLAINED_RATIO = 0.9  # of its visible voxels that the earlier scan hit where they came from
_MIN_GAIN_RATIO = 0.05  # by which more of them are explained than of a static body

# A front or rear is at most 1.5 m long, and shows that it moved by 5 voxels and half of those that could show it.
_END_M, _MIN_END_VOXELS, _MIN_END_RATIO = 1.5, 5, 0.5
# Share of a body that moved in the scan before, with which it goes on without an end that shows.
_MIN_MOVED_BEFORE_RATIO = 0.5
_MAX_TAKEN_RATIO = 0.3  # of the places of the rear of then at which the newest scan has returns
_MIN_CAME_M = 0.35  # since a younger scan that tells whether a body at a steady speed has stopped
# Ratio of the voxels of the ends that this scan shows in their places to those on their way.
_STOPPED_RATIO = 2.0


@dataclass(frozen=True)
class _Body:
    """A cluster along one direction of one of its axes.

    Attributes:
        rows: (B,) its voxels within the width of what appeared.
        axis: (3,) direction of motion.
        front: (F,) some of the voxels at the front.
        rear: (R,) some of the voxels at the rear.
        sides: (S,) some of all voxels.
        advanced: Number of new voxels at the front.
        is_front_cut: Whether the front lies beyond the area.
        is_rear_cut: Whether the rear does.
    """

    rows: Int
    axis: Float32
    front: Int
    rear: Int
    sides: Int
    advanced: int
    is_front_cut: bool
    is_rear_cut: bool

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
        appeared: (V,) whether the place was free in older scans.
        is_new: (V,) whether no scan had a return from the place, not even the youngest.
        was_moving: (V,) whether something that moved in the scan before is near.
        moves: (V,) whether it is known to move.
        area: Local area that holds them all.
    """

    places_m: Float32
    clusters: Int
    appeared: Bool
    is_new: Bool
    was_moving: Bool
    moves: Bool
    area: LocalArea

    def are_cut(self, rows: Int, direction: Float32) -> bool:
        """Return whether most of some voxels are at the edge of the area that lies in a direction."""
        beyond = self.places_m[rows] + _EDGE_M * direction
        return bool(np.mean(self.area.contains_xy(beyond)) < 0.5)


def moving_bodies(occupied: OccupiedPlaces, memory: FreeSpaceMemory, age_s: float) -> Bool:
    """Return which of V occupied voxels belong to bodies that move along one of their axes."""
    moves = np.zeros(len(occupied.moves), bool)
    bodies = _bodies(occupied)
    farthest_m = min(_MAX_DISTANCE_M, _MAX_SPEED_M_S * age_s)
    distances_m = np.append(0.0, np.arange(_MIN_DISTANCE_M, farthest_m, _STEP_M)).astype(np.float32)
    if not bodies:
        return moves
    moved = [
        _moved_back(occupied.places_m[body.samples], body.axis, distances_m) for body in bodies
    ]
    ages = memory.queried_ages()
    states = memory.states(np.concatenate(moved), ages[-1])
    starts = np.cumsum([0, *(len(part) for part in moved)])
    search = _Search(occupied, memory, distances_m)
    for body, places_m, start, stop in zip(bodies, moved, starts[:-1], starts[1:], strict=True):
        moves[body.rows] |= search.moves(body, places_m, states[start:stop])
    return moves


@dataclass(frozen=True)
class _Search:
    """Search of the distance that a body has come.

    Attributes:
        occupied: All voxels.
        memory: Earlier scans.
        distances_m: (D,) distances since the oldest queried scan that are tried, the first 0.
    """

    occupied: OccupiedPlaces
    memory: FreeSpaceMemory
    distances_m: Float32

    def moves(self, body: _Body, moved_m: Float32, states: UInt8) -> bool:
        """Return whether a body moves, by the oldest scan or, where that is hidden from it, by a younger one.

        Its samples, moved back by each distance, are at (D * S, 3) places, of (D * S,) visibility in the oldest scan.
        """
        ages, seen = self.memory.queried_ages(), states.reshape(len(self.distances_m), -1)
        while not self._moves_since(body, ages, seen):
            if len(ages) <= _MIN_AGES or not _is_hidden(seen[0]):
                return False
            ages = ages[:-1]
            seen = self.memory.states(moved_m, ages[-1]).reshape(seen.shape)
        return True

    def _moves_since(self, body: _Body, ages: list[int], seen: UInt8) -> bool:
        """Return whether a distance since the oldest of some scans tells that a body moves.

        Args:
            body: Body.
            ages: Ages of these scans, in scans, rising.
            seen: (D, S) visibility of the samples in the oldest of them, moved back by each distance.
        """
        moved_before = self.occupied.was_moving[body.rows].mean() >= _MIN_MOVED_BEFORE_RATIO
        rows, gains = _likely_distances(seen)
        if not len(rows):
            return False
        moved_m = _moved_back(self.occupied.places_m[body.rear], body.axis, self.distances_m)
        rears_now = self.memory.states(moved_m, 0).reshape(len(self.distances_m), -1)
        for row in rows:
            path = _Path(
                self.occupied,
                self.memory,
                body,
                ages,
                float(self.distances_m[row]),
                seen[row],
                rears_now[row],
            )
            if not gains[row]:
                shows = path.leaves_steadily()
            else:
                shows = moved_before or path.has_an_end(seen[0])
            if shows and path.has_stopped():
                moved_before = False
            elif shows and path.is_open() and path.has_width():
                return True
        return False


def _bodies(occupied: OccupiedPlaces) -> list[_Body]:
    """Return the clusters in which enough is new, along both directions of each of their axes."""
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
        if not _MIN_LENGTH_M <= length_m <= _MAX_LENGTH_M:
            continue
        turns = 2 if length_m > _LONG_M else 4
        for turn_rad in np.pi / 2 * np.array([0, 2, 1, 3])[:turns]:
            body = _body(occupied, rows, heading_rad + turn_rad)
            bodies += [] if body is None else [body]
    return bodies


def _body(occupied: OccupiedPlaces, rows: Int, heading_rad: float) -> _Body | None:
    """Return the part of a cluster that may be a body: all of it if it is as wide as a vehicle, else what is in line."""
    axis = np.array([np.cos(heading_rad), np.sin(heading_rad), 0.0], np.float32)
    left_m = occupied.places_m[rows] @ np.array([-axis[1], axis[0], 0.0], np.float32)
    if np.ptp(left_m) > _MAX_WIDTH_M:
        in_line, margin_m = occupied.is_new[rows], _SIDE_MARGIN_M
        if np.count_nonzero(in_line) < _MIN_NEW_VOXELS:
            # What is beside it must not come along scan after scan.
            in_line, margin_m = occupied.was_moving[rows], 0.0
        if np.count_nonzero(in_line) < _MIN_NEW_VOXELS:
            return None
        low_m, high_m = np.quantile(
            left_m[in_line], (0.01, 0.99) if margin_m == 0 else (0.05, 0.95)
        )
        rows = rows[(left_m > low_m - margin_m) & (left_m < high_m + margin_m)]
    along_m = occupied.places_m[rows] @ axis
    front = rows[along_m > along_m.max() - _END_M]
    rear = rows[along_m < along_m.min() + _END_M]
    count = _SAMPLES
    advanced = int(np.count_nonzero(occupied.is_new[front]))
    tips = rows[along_m > along_m.max() - _EDGE_M], rows[along_m < along_m.min() + _EDGE_M]
    return _Body(
        rows,
        axis,
        _thinned(front, count),
        _thinned(rear, count),
        _thinned(rows, count),
        advanced,
        is_front_cut=occupied.are_cut(tips[0], axis),
        is_rear_cut=occupied.are_cut(tips[1], -axis),
    )


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


def _is_hidden(states: UInt8) -> bool:
    """Return whether an earlier scan could not see most of (S,) places."""
    return bool(np.isin(states, (Visibility.HIT, Visibility.FREE)).mean() < 0.5)


def _likely_distances(states: UInt8) -> tuple[Int, Bool]:
    """Return the rows of the distances that fit the earlier scan, the best first, and which explain it better than 0.

    Args:
        states: (D, S) visibility of the samples in that scan, moved back by each distance; the first is 0.
    """
    hits = (states == Visibility.HIT).sum(axis=1)
    explained = hits / np.maximum((states != Visibility.UNKNOWN).sum(axis=1), 1)
    fits = _fits(states)
    fits[0] = False
    gains = fits & (explained - explained[0] >= _MIN_GAIN_RATIO)
    best_first = np.argsort(-explained, kind="stable")
    return np.asarray(best_first[fits[best_first]]), gains


@dataclass(frozen=True)
class _Path:
    """The way that a body may have come since the oldest queried scan.

    Attributes:
        occupied: All voxels.
        memory: Earlier scans.
        body: Body.
        ages: Ages of the scans that tell, in scans, rising.
        distance_m: Distance that it came since the oldest, in metres.
        samples_then: (S,) visibility of the samples in the oldest scan, where they were.
        rear_now: (R,) visibility in the newest scan of the places where the rear was.
    """

    occupied: OccupiedPlaces
    memory: FreeSpaceMemory
    body: _Body
    ages: list[int]
    distance_m: float
    samples_then: UInt8
    rear_now: UInt8

    def has_an_end(self, at_rest: UInt8) -> bool:
        """Return whether the front appeared where it was not, or the rear has left where it was.

        Args:
            at_rest: (S,) visibility of the samples in the oldest scan, where they are now.
        """
        body, front = self.body, len(self.body.front)
        is_hit = self.samples_then == Visibility.HIT
        is_first = self._is_in_end(body.front, body.axis, self.distance_m)
        came = (is_hit[:front] & self.occupied.appeared[body.front])[is_first]
        is_visible = np.isin(at_rest[:front], (Visibility.HIT, Visibility.FREE))
        appears = _shows_an_end(came, int(np.count_nonzero(is_visible[is_first])))
        if appears and not body.is_front_cut and body.advanced >= _MIN_END_VOXELS:
            return True
        return self._leaves(self._rear_was_hit, self.rear_now, self.distance_m)

    def leaves_steadily(self) -> bool:
        """Return whether the rear has left where a steady speed puts it in the oldest scan and in the one after it.

        Of a body whose front is beyond the area or hidden, nothing else tells: its sides fill the place that they
        filled before.
        """
        body = self.body
        younger = self.ages[:-1]
        came_m = self._came_m(younger[-1]) if younger else 0.0
        if came_m < _MIN_CAME_M:
            return False
        if not self._leaves(self._rear_was_hit, self.rear_now, self.distance_m):
            return False
        places_m = self.occupied.places_m[body.rear]
        moved = _moved_back(places_m, body.axis, np.array([came_m], np.float32))
        was_hit = self.memory.states(moved, younger[-1]) == Visibility.HIT
        return self._leaves(was_hit, self.memory.states(moved, 0), came_m)

    @property
    def _rear_was_hit(self) -> Bool:
        """(R,) whether the oldest scan hit the rear where it was."""
        front = len(self.body.front)
        return np.asarray(self.samples_then[front : front + len(self.body.rear)] == Visibility.HIT)

    def _leaves(self, was_hit: Bool, states_now: UInt8, distance_m: float) -> bool:
        """Return whether beams pass now where the rear was a distance back.

        Args:
            was_hit: (R,) whether the scan of then hit the rear there.
            states_now: (R,) visibility of these places in the newest scan.
            distance_m: Distance that it came since then.
        """
        body = self.body
        if body.is_rear_cut:
            return False
        left = was_hit & (states_now == Visibility.FREE)
        left = left[self._is_in_end(body.rear, -body.axis, distance_m)]
        return _shows_an_end(left, len(left))

    def is_open(self) -> bool:
        """Return whether the body was on its way in between, and nothing else is where its rear was.

        One of a row of parked cars fits the place of its neighbour, who is still there.
        """
        is_last = self._is_in_end(self.body.rear, -self.body.axis, self.distance_m)
        taken = (self.rear_now == Visibility.HIT)[is_last]
        if not self.body.is_rear_cut and len(taken) and taken.mean() > _MAX_TAKEN_RATIO:
            return False
        return all(self._was_on_its_way(age) for age in self.ages[:-1])

    def has_width(self) -> bool:
        """Return whether the body is as wide as a vehicle, or hides what would be inside it behind its only visible side.

        A fence hides little.
        """
        body, places_m = self.body, self.occupied.places_m
        across = np.array([-body.axis[1], body.axis[0], 0.0], np.float32)
        left_m, along_m = places_m[body.rows] @ across, places_m[body.rows] @ body.axis
        min_width_m = max(MIN_WIDTH_M, float(np.ptp(along_m)) / MAX_LENGTH_PER_WIDTH)
        # A twig or a sign beside a fence does not make it wide.
        if np.diff(np.quantile(left_m, (0.05, 0.95)))[0] >= min_width_m:
            return True
        inwards_m = np.copysign(np.float32(MIN_WIDTH_M), left_m.mean())
        states = self.memory.states(places_m[body.samples] + inwards_m * across, 0)
        return bool(np.mean(states == Visibility.OCCLUDED) >= _MIN_HIDDEN_RATIO)

    def has_stopped(self) -> bool:
        """Return whether the ends were already in their places in the youngest scan that can tell.

        At a steady speed the places of the front were free then, and the rear hid its own from behind.
        """
        telling = [age for age in self.ages[:-1] if self._came_m(age) >= _MIN_CAME_M]
        if not telling:
            return False
        came_m = np.array([0.0, self._came_m(telling[0])], np.float32)
        body, places_m = self.body, self.occupied.places_m
        front = body.front[
            self._is_in_end(body.front, body.axis, came_m[1]) & (not body.is_front_cut)
        ]
        rear = body.rear[self._is_in_end(body.rear, -body.axis, came_m[1]) & (not body.is_rear_cut)]
        if len(front) + len(rear) == 0:
            return False
        front_now = self.memory.states(places_m[front], telling[0])
        moved = _moved_back(places_m[rear], body.axis, came_m)
        rear_now, rear_then = self.memory.states(moved, telling[0]).reshape(2, -1)
        hit, free = Visibility.HIT, Visibility.FREE
        stayed = np.count_nonzero(front_now == hit) + np.count_nonzero(rear_then == free)
        came = np.count_nonzero(front_now == free) + np.count_nonzero(rear_then == hit)
        came += np.count_nonzero(rear_now == Visibility.OCCLUDED)
        return bool(stayed > _STOPPED_RATIO * came)

    def _came_m(self, age: int) -> float:
        """Return how far a steady speed brought it since an earlier scan."""
        return self.distance_m * self.memory.age_s(age) / self.memory.age_s(self.ages[-1])

    def _was_on_its_way(self, age: int) -> bool:
        """Return whether an earlier scan hit the body somewhere near where a steady speed puts it then."""
        distances_m = self._came_m(age) * _SPEEDS_ON_THE_WAY
        places_m = self.occupied.places_m[self.body.samples]
        moved = _moved_back(places_m, self.body.axis, distances_m.astype(np.float32))
        return bool(_fits(self.memory.states(moved, age).reshape(len(distances_m), -1)).any())

    def _is_in_end(self, rows: Int, axis: Float32, distance_m: float) -> Bool:
        """Return which voxels are within a distance of the outermost along an axis."""
        along_m = self.occupied.places_m[rows] @ axis
        return np.asarray(along_m > along_m.max() - distance_m)


def _shows_an_end(tells: Bool, places: int) -> bool:
    """Return whether enough voxels of an end tell that it moved, of those whose places count."""
    count = int(np.count_nonzero(tells))
    return count >= _MIN_END_VOXELS and count > _MIN_END_RATIO * places


def _fits(states: UInt8) -> Bool:
    """Return whether (D, S) places were hit rather than free, at each of D distances."""
    hits = (states == Visibility.HIT).sum(axis=1)
    free = (states == Visibility.FREE).sum(axis=1)
    return np.asarray((hits > 0) & (hits >= _MIN_EXPLAINED_RATIO * (hits + free)))
