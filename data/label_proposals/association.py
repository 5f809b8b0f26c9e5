"""Observations of one object, found over the whole drive: linked forwards and backwards in time, then joined over gaps.

Nothing is decided at a low score: what is no object is told at the end, by all observations of it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any

import numpy as np
from scipy.spatial import cKDTree

from data.label_proposals.observations import Observations
from perception.detection.bev.classes import GROUPS
from perception.geometry.box_overlap import iou_bev, paired_iou_bev
from perception.tracking.association import assign_with_max_cost
from perception.types import ArrayTable, Bool, Float64, Int

# Of each group, others last: deviations of the acceleration and of an unknown speed.
ACCELERATION_M_S2 = np.array([2.0, 1.5, 0.8, 1.5])
_SPEED_M_S = np.array([6.0, 4.0, 1.2, 4.0])
_KNOWN_SPEED_M_S = 2.0  # deviation of a speed that a frame's tracker states
# Deviation of a place: at its best, at score 0, by distance.
_BEST_M, _WORST_M, _PER_M = 0.15, 0.5, 0.004
_AXIS_RAD = 0.5  # deviation of the axis of a vehicle
_GATE = 12.0  # squared deviations
_NEW_PER_M2 = 0.004  # objects that begin or end anywhere, which a link must be more likely than
_MAX_GAP_S = 1.2  # of a link
_MAX_JOIN_S = 2.5  # between parts that are joined, but for vehicles that rest
# Of each group: distance of motions that meet, and its growth with the gap.
_JOIN_M, _JOIN_M_S = np.array([0.9, 0.8, 0.6, 0.8]), np.array([2.0, 1.5, 0.6, 1.5])
# Time and least number of observations that tell the motion at an end of a part.
_END_S, _END = 1.0, 5
# Of each group: overlap of two observations of one object; vehicles keep apart, people do not.
_DUPLICATE_IOU, _DUPLICATE_M = np.array([0.05, 0.3, 0.3, 0.3]), 0.4
_STATIC_M_S, _STATIC_M = 0.25, 0.6
_DRIFT_M_S, _DRIFT_S = 0.4, 1.0  # of poses, which let a parked vehicle drift for longer than a time
# Time, way, and its ratio to the scatter about it, from which a vehicle drives: another view of a parked one jumps.
_WAY_S, _WAY_M, _WAY_RATIO = 1.0, 2.0, 8.0
_SURE = 0.5  # score of observations that tell it
_SAME_PLACE_IOU, _SAME_PLACE_M, _MAX_DRIFT_M = 0.2, 0.7, 3.0
_MOVES = 1.0  # least cost of a pair that moves
_VEHICLES = GROUPS["Car"]


def link(observations: Observations) -> list[Int]:
    """Return the rows of each object, in order of time."""
    kept = np.flatnonzero(~_are_duplicates(observations))
    used = observations[kept]
    if not len(used):
        return []
    ahead, back = _links(used, 1), _links(used, -1)
    # A link that holds in one direction of time alone is none.
    parts = _chains(np.where(back[ahead] == np.arange(len(used)), ahead, -1))
    return [kept[rows] for rows in _joined(used, parts)]


def deviations_m(observations: Observations) -> Float64:
    """Return the (R,) standard deviations of places along each axis."""
    away = observations.sensors_world - observations.boxes_world.bottom_m[:, :2]
    unsure_m = (_WORST_M - _BEST_M) * (1 - observations.scores)
    return np.asarray(_BEST_M + unsure_m + _PER_M * np.linalg.norm(away, axis=1))


def is_static(seen: Observations, places_m: Float64) -> bool:
    """Return whether an object stays where it is, by the (K, 2) places of its observations.

    A vehicle may drift for long, but drives nowhere: its place is as good as the poses are.
    """
    stamps_s, group = seen.stamps_s, seen.groups[0]
    third = max(len(stamps_s) // 3, 1)
    first_m, last_m = (np.median(places_m[part], axis=0) for part in (slice(third), slice(-third, None)))  # fmt: skip
    span_s = np.median(stamps_s[-third:]) - np.median(stamps_s[:third])
    way_m = np.linalg.norm(last_m - first_m)
    if group == _VEHICLES and span_s > _DRIFT_S and way_m < _DRIFT_M_S * span_s:
        is_sure = seen.scores > _SURE
        return not _drives(stamps_s[is_sure], places_m[is_sure])
    return bool(way_m < _STATIC_M and way_m <= max(_STATIC_M_S * span_s, 0.35))


def _drives(stamps_s: Float64, places_m: Float64) -> bool:
    """Return whether (K, 2) places at (K,) times advance along a line for a while."""
    starts = np.arange(len(stamps_s))
    stops = np.maximum(np.searchsorted(stamps_s, stamps_s + _WAY_S) + 1, starts + _END)
    for start, stop in zip(starts.tolist(), stops[stops <= len(stamps_s)].tolist(), strict=False):
        times_s, places = stamps_s[start:stop], places_m[start:stop]
        way_m = places[-1] - places[0]
        if np.linalg.norm(way_m) > _WAY_M:
            middle_m, velocity_m_s = _line(times_s, places, times_s[0])
            line_m = middle_m + (times_s - times_s[0])[:, None] * velocity_m_s
            scatter_m = np.sqrt(((places - line_m) ** 2).sum(axis=1).mean())
            length_m = np.linalg.norm(velocity_m_s) * (times_s[-1] - times_s[0])
            if length_m > max(_WAY_M, _WAY_RATIO * scatter_m):
                return True
    return False


def _frames_of(observations: Observations) -> Iterator[Int]:
    """Yield the rows of each frame."""
    order = np.argsort(observations.frames, kind="stable")
    edges = np.flatnonzero(np.diff(observations.frames[order])) + 1
    yield from np.split(order, edges)


def _are_duplicates(observations: Observations) -> Bool:
    """Return whether a better observation of the same group and frame is at the place of each."""
    result = np.zeros(len(observations), bool)
    for unordered in _frames_of(observations):
        rows = unordered[np.argsort(-observations.scores[unordered], kind="stable")]
        boxes, groups = observations.boxes_world[rows], observations.groups[rows]
        overlaps = iou_bev(boxes, boxes) > _DUPLICATE_IOU[groups][:, None]
        near_m = np.linalg.norm(boxes.bottom_m[:, None, :2] - boxes.bottom_m[None, :, :2], axis=2)
        same = (overlaps | (near_m < _DUPLICATE_M)) & (groups[:, None] == groups)
        for place in range(1, len(rows)):
            better = rows[:place][same[place, :place]]
            result[rows[place]] = bool((~result[better]).any())
    return result


@dataclass(frozen=True)
class _Tracks(ArrayTable):
    """T objects so far, each with constant velocity; the axes have the same covariance.

    Attributes:
        rows: (T,) row of the newest observation.
        stamps_s: (T,) its time.
        places_m: (T, 2) place.
        velocities_m_s: (T, 2) velocity.
        covariances: (T, 3) variance of the place, covariance, variance of the velocity.
        groups: (T,) group of the class.
        yaw_rad: (T,) axis.
    """

    rows: Int
    stamps_s: Float64
    places_m: Annotated[Float64, 2]
    velocities_m_s: Annotated[Float64, 2]
    covariances: Annotated[Float64, 3]
    groups: Int
    yaw_rad: Float64

    @classmethod
    def of(cls, seen: Observations, rows: Int, direction: int) -> "_Tracks":
        """Return new tracks of observations in some rows, in a direction of time."""
        velocities = direction * seen.velocities_m_s
        is_known = np.asarray(np.isfinite(velocities).all(axis=1))
        speeds = np.where(is_known, _KNOWN_SPEED_M_S, _SPEED_M_S[seen.groups])
        return cls(
            rows,
            direction * seen.stamps_s,
            seen.boxes_world.bottom_m[:, :2],
            np.where(is_known[:, None], velocities, 0.0),
            np.column_stack([deviations_m(seen) ** 2, np.zeros(len(rows)), speeds**2]),
            seen.groups,
            seen.boxes_world.yaw_rad,
        )

    def at(self, stamp_s: float) -> "_Tracks":
        """Return the tracks at a time."""
        step = stamp_s - self.stamps_s
        place, both, speed = self.covariances.T
        noise = ACCELERATION_M_S2[self.groups] ** 2
        covariances = np.column_stack(
            [
                place + 2 * step * both + step**2 * speed + noise * step**4 / 4,
                both + step * speed + noise * step**3 / 2,
                speed + noise * step**2,
            ]
        )
        places = self.places_m + step[:, None] * self.velocities_m_s
        return replace(self, places_m=places, covariances=covariances)

    def updated(self, seen: Observations, rows: Int, stamp_s: float) -> "_Tracks":
        """Return predicted tracks with an observation of each, in some rows."""
        place, both, speed = self.covariances.T
        gains = np.column_stack([place, both]) / (place + deviations_m(seen) ** 2)[:, None]
        away = seen.boxes_world.bottom_m[:, :2] - self.places_m
        return replace(
            self,
            rows=rows,
            stamps_s=np.full(len(rows), stamp_s),
            places_m=self.places_m + gains[:, :1] * away,
            velocities_m_s=self.velocities_m_s + gains[:, 1:] * away,
            covariances=np.column_stack(
                [place - gains[:, 0] * place, both - gains[:, 0] * both, speed - gains[:, 1] * both]
            ),
            yaw_rad=seen.boxes_world.yaw_rad,
        )

    def costs(self, seen: Observations) -> Float64:
        """Return (T, D) twice the negative log-likelihood of observations; infinite beyond the gate."""
        spread = self.covariances[:, :1] + deviations_m(seen) ** 2
        away = self.places_m[:, None] - seen.boxes_world.bottom_m[None, :, :2]
        squares = (away**2).sum(axis=2) / spread
        turned = np.sin(self.yaw_rad[:, None] - seen.boxes_world.yaw_rad) / _AXIS_RAD
        squares += np.where((self.groups == _VEHICLES)[:, None], turned**2, 0.0)
        is_near = (squares < _GATE) & (self.groups[:, None] == seen.groups)
        return np.where(is_near, squares + 2 * np.log(spread), np.inf)


def _links(observations: Observations, direction: int) -> Int:
    """Return the (R,) row of the next observation of the same object in a direction of time, -1 for none."""
    max_cost = -2 * np.log(2 * np.pi * _NEW_PER_M2)
    result = np.full(len(observations), -1)
    tracks = _Tracks.empty()
    for rows in list(_frames_of(observations))[::direction]:
        seen = observations[rows]
        stamp_s = direction * float(seen.stamps_s[0])
        tracks = tracks[stamp_s - tracks.stamps_s <= _MAX_GAP_S]
        predicted = tracks.at(stamp_s)
        costs = predicted.costs(seen)
        found = assign_with_max_cost(costs, np.isfinite(costs), max_cost)
        old, now, new = found.tracks, found.detections, found.unmatched_detections
        result[tracks.rows[old]] = rows[now]
        tracks = _Tracks.concatenate(
            [
                predicted[old].updated(seen[now], rows[now], stamp_s),
                tracks[found.unmatched_tracks],
                _Tracks.of(seen[new], rows[new], direction),
            ]
        )
    return result


def _chains(follows: Int) -> list[Int]:
    """Return the rows of each chain, by the (R,) row that follows each, -1 for none."""
    chains = []
    for first in np.setdiff1d(np.arange(len(follows)), follows).tolist():
        rows = [first]
        while follows[rows[-1]] >= 0:
            rows.append(int(follows[rows[-1]]))
        chains.append(np.array(rows))
    return chains


@dataclass(frozen=True)
class _Parts(ArrayTable):
    """P parts of objects.

    Attributes:
        groups: (P,) groups.
        first_s: (P,) times of the first observations.
        last_s: (P,) times of the last ones.
        is_static: (P,) whether they stay where they are.
        starts_m: (P, 2) places at the first observations.
        stops_m: (P, 2) places at the last ones.
        start_m_s: (P, 2) velocities at the first observations.
        stop_m_s: (P, 2) velocities at the last ones.
        middles_m: (P, 2) medians of the places.
        best: (P,) rows of the observations of the highest score.
    """

    groups: Int
    first_s: Float64
    last_s: Float64
    is_static: Bool
    starts_m: Annotated[Float64, 2]
    stops_m: Annotated[Float64, 2]
    start_m_s: Annotated[Float64, 2]
    stop_m_s: Annotated[Float64, 2]
    middles_m: Annotated[Float64, 2]
    best: Int

    @classmethod
    def of(cls, observations: Observations, parts: Sequence[Int]) -> "_Parts":
        """Return parts of observations in rows in order of time."""
        columns: list[list[Any]] = [[] for _ in fields(cls)]
        for rows in parts:
            stamps_s = observations.stamps_s[rows]
            places, group = (
                observations.boxes_world.bottom_m[rows, :2],
                observations.groups[rows[0]],
            )
            start = max(_END, int(np.searchsorted(stamps_s, stamps_s[0] + _END_S)))
            stop = min(len(rows) - _END, int(np.searchsorted(stamps_s, stamps_s[-1] - _END_S)))
            start_m, start_m_s = _line(stamps_s[:start], places[:start], stamps_s[0])
            stop_m, stop_m_s = _line(stamps_s[max(stop, 0) :], places[max(stop, 0) :], stamps_s[-1])
            middle_m, best = np.median(places, axis=0), rows[observations.scores[rows].argmax()]
            rests = is_static(observations[rows], places)
            ends = (start_m, stop_m, start_m_s, stop_m_s)
            values = (group, stamps_s[0], stamps_s[-1], rests, *ends, middle_m, best)
            for column, value in zip(columns, values, strict=True):
                column.append(value)
        return cls(*map(np.array, columns))


def _line(stamps_s: Float64, places: Float64, at_s: float) -> tuple[Float64, Float64]:
    """Return place and velocity at a time."""
    middle_s, middle_m = stamps_s.mean(), places.mean(axis=0)
    if len(stamps_s) < 3:
        return middle_m, np.zeros(2)
    away_s = stamps_s - middle_s
    velocity = away_s @ places / (away_s @ away_s)
    return middle_m + (at_s - middle_s) * velocity, velocity


def _joined(observations: Observations, parts: list[Int]) -> list[Int]:
    """Join parts of one object: at one place of the world where it is static, else where the motions meet in a gap."""
    of_parts = _Parts.of(observations, parts)
    first, second, costs = (
        np.concatenate(pair)
        for pair in zip(_at_one_place(observations, of_parts), _in_line(of_parts), strict=True)
    )
    frames = [set(observations.frames[rows].tolist()) for rows in parts]
    owner = list(range(len(parts)))
    members = {number: [number] for number in owner}
    for pair in np.argsort(costs, kind="stable").tolist():
        a, b = owner[first[pair]], owner[second[pair]]
        if a == b or frames[a] & frames[b]:
            continue
        frames[a] |= frames[b]
        members[a] += members.pop(b)
        for number in members[a]:
            owner[number] = a
    whole = [np.concatenate([parts[one] for one in ones]) for ones in members.values()]
    return [rows[np.argsort(observations.frames[rows], kind="stable")] for rows in whole]


def _at_one_place(observations: Observations, parts: _Parts) -> tuple[Int, Int, Float64]:
    """Return pairs of static parts at one place, and the cost of each pair."""
    rows = np.flatnonzero(parts.is_static)
    near = cKDTree(parts.middles_m[rows]).query_pairs(_MAX_DRIFT_M, output_type="ndarray")
    pairs = rows[near.reshape(-1, 2)]
    order = np.argsort(parts.first_s[pairs], axis=1, kind="stable")
    pairs = np.take_along_axis(pairs, order, axis=1)
    a, b = parts[pairs[:, 0]], parts[pairs[:, 1]]
    gap_s = np.maximum(b.first_s - a.last_s, 0.0)
    boxes = observations.boxes_world
    overlaps = paired_iou_bev(boxes[a.best], boxes[b.best])
    # The end of one and the start of the next are nearer than their middles where poses drift.
    ends_m = np.linalg.norm(b.starts_m - a.stops_m, axis=1)
    away_m = np.minimum(np.linalg.norm(b.middles_m - a.middles_m, axis=1), ends_m)
    is_same = (a.groups == b.groups) & ((away_m < _SAME_PLACE_M) | (overlaps > _SAME_PLACE_IOU))
    is_same &= (a.groups == _VEHICLES) | (gap_s < _MAX_JOIN_S)
    return pairs[is_same, 0], pairs[is_same, 1], away_m[is_same] / _MAX_DRIFT_M / 2


def _in_line(parts: _Parts) -> tuple[Int, Int, Float64]:
    """Return pairs of parts, one after the other, whose motions meet in the gap, and the cost of each pair."""
    order = np.argsort(parts.first_s, kind="stable")
    starts_s = parts.first_s[order]
    low = np.searchsorted(starts_s, parts.last_s, side="right")
    counts = np.searchsorted(starts_s, parts.last_s + _MAX_JOIN_S, side="right") - low
    before = np.repeat(np.arange(len(parts)), counts)
    after = order[np.arange(len(before)) - np.repeat(np.cumsum(counts) - counts - low, counts)]
    kept = parts.groups[before] == parts.groups[after]
    before, after = before[kept], after[kept]
    a, b = parts[before], parts[after]
    gap_s = (b.first_s - a.last_s)[:, None]
    ahead = a.stops_m + gap_s * a.stop_m_s - b.starts_m
    behind = b.starts_m - gap_s * b.start_m_s - a.stops_m
    away_m = np.minimum(np.linalg.norm(ahead, axis=1), np.linalg.norm(behind, axis=1))
    limit_m = _JOIN_M[a.groups] + _JOIN_M_S[a.groups] * gap_s[:, 0]
    is_near = away_m < limit_m
    return before[is_near], after[is_near], _MOVES + (away_m / limit_m)[is_near]
