"""Observations of one object, found over the whole drive: linked from frame to frame, then joined over gaps.

Nothing is decided at a low score: what is no object is told at the end, by all observations of it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from data.label_proposals.observations import Observations
from perception.detection.bev.classes import GROUPS
from perception.geometry.box_overlap import iou_bev, paired_iou_bev
from perception.tracking.association import assign_with_max_cost
from perception.types import Bool, Float64, Int

_MAX_GAP_S = 1.2  # of a link, and between parts that are joined
_MAX_JOIN_S = 2.5
# Of each group: distance from the predicted place that noise explains, and speeds that a change and a start explain.
_NOISE_M = np.array([0.9, 0.8, 0.6, 0.8])
_CHANGE_M_S = np.array([4.0, 3.0, 1.2, 3.0])
_START_M_S = np.array([9.0, 6.0, 2.0, 6.0])
_SMOOTHING = 0.5  # share of the newest velocity
_DUPLICATE_IOU = 0.3
_STATIC_M_S, _STATIC_M = 0.25, 0.6
_SAME_PLACE_IOU, _SAME_PLACE_M = 0.2, 0.7
_MAX_JOIN_M = 40.0  # between the middles of parts
_VEHICLES = GROUPS["Car"]


@dataclass
class _Part:
    """Observations of one object so far.

    Attributes:
        rows: Rows of the observations.
        stamp_s: Time of the newest one.
        place_m: (2,) its place.
        velocity_m_s: (2,) velocity, NaN before it is known.
        group: Group of its class.
    """

    rows: list[int]
    stamp_s: float
    place_m: Float64
    velocity_m_s: Float64
    group: int


def link(observations: Observations) -> list[Int]:
    """Return the rows of each object, in order of time."""
    kept = np.flatnonzero(~_are_duplicates(observations))
    used = observations[kept]
    return [kept[rows] for rows in _joined(used, _linked(used))] if len(used) else []


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
        overlaps = iou_bev(boxes, boxes) > _DUPLICATE_IOU
        near_m = np.linalg.norm(boxes.bottom_m[:, None, :2] - boxes.bottom_m[None, :, :2], axis=2)
        same = (overlaps | (near_m < 0.4)) & (groups[:, None] == groups)
        for place in range(1, len(rows)):
            better = rows[:place][same[place, :place]]
            result[rows[place]] = bool((~result[better]).any())
    return result


def _linked(observations: Observations) -> list[Int]:
    parts: list[_Part] = []
    active: list[_Part] = []
    for rows in _frames_of(observations):
        now_s = float(observations.stamps_s[rows[0]])
        active = [one for one in active if now_s - one.stamp_s <= _MAX_GAP_S]
        places, groups = observations.boxes_world.bottom_m[rows, :2], observations.groups[rows]
        costs = _costs(active, places, groups, now_s)
        found = assign_with_max_cost(costs, np.isfinite(costs), 1.0)
        for number, place in zip(found.tracks.tolist(), found.detections.tolist(), strict=True):
            _extend(active[number], int(rows[place]), observations)
        for place in found.unmatched_detections.tolist():
            row = int(rows[place])
            velocity = observations.velocities_m_s[row]
            active.append(_Part([row], now_s, places[place], velocity, int(groups[place])))
            parts.append(active[-1])
    return [np.array(one.rows) for one in parts]


def _costs(active: Sequence[_Part], places: Float64, groups: Int, now_s: float) -> Float64:
    """Return (T, D) distances of observations from predicted places, in gates; infinite in another group."""
    if not active:
        return np.zeros((0, len(places)))
    group = np.array([one.group for one in active])
    elapsed_s = np.array([now_s - one.stamp_s for one in active])
    velocities = np.stack([one.velocity_m_s for one in active])
    is_known = np.isfinite(velocities.sum(axis=1))
    predicted = np.stack([one.place_m for one in active])
    predicted = predicted + np.where(is_known[:, None], velocities, 0) * elapsed_s[:, None]
    speed_m_s = np.where(is_known, _CHANGE_M_S[group], _START_M_S[group])
    gates_m = _NOISE_M[group] + speed_m_s * elapsed_s
    distances_m = np.linalg.norm(predicted[:, None] - places[None], axis=2)
    return np.where(group[:, None] == groups, distances_m / gates_m[:, None], np.inf)


def _extend(part: _Part, row: int, observations: Observations) -> None:
    place, stamp_s = observations.boxes_world.bottom_m[row, :2], float(observations.stamps_s[row])
    velocity = (place - part.place_m) / (stamp_s - part.stamp_s)
    if np.isfinite(part.velocity_m_s).all():
        velocity = _SMOOTHING * velocity + (1 - _SMOOTHING) * part.velocity_m_s
    part.rows.append(row)
    part.stamp_s, part.place_m, part.velocity_m_s = stamp_s, place, velocity


@dataclass(frozen=True)
class _Motion:
    """Straight motion of a part.

    Attributes:
        first_s: Time of its first observation.
        last_s: Time of its last one.
        middle_m: (2,) median of its places.
        is_static: Whether it stays where it is.
        start: Place and velocity at the first observation.
        stop: The same at the last one.
    """

    first_s: float
    last_s: float
    middle_m: Float64
    is_static: bool
    start: tuple[Float64, Float64]
    stop: tuple[Float64, Float64]

    @classmethod
    def of(cls, observations: Observations) -> "_Motion":
        """Return the motion of the observations of a part."""
        stamps_s, places = observations.stamps_s, observations.boxes_world.bottom_m[:, :2]
        middle_m = np.median(places, axis=0)
        ends = []
        for side in (slice(None, 5), slice(-5, None)):
            ends.append(
                _line(stamps_s[side], places[side], stamps_s[0 if side.start is None else -1])
            )
        return cls(
            float(stamps_s[0]),
            float(stamps_s[-1]),
            middle_m,
            is_static(stamps_s, places),
            ends[0],
            ends[1],
        )


def is_static(stamps_s: Float64, places_m: Float64) -> bool:
    """Return whether an object stays where it is, by (K, 2) places at (K,) times."""
    count = len(stamps_s)
    third = max(count // 3, 1)
    way_m = np.linalg.norm(
        np.median(places_m[-third:], axis=0) - np.median(places_m[:third], axis=0)
    )
    span_s = np.median(stamps_s[-third:]) - np.median(stamps_s[:third])
    return bool(way_m < _STATIC_M and way_m <= max(_STATIC_M_S * span_s, 0.35))


def _line(stamps_s: Float64, places: Float64, at_s: float) -> tuple[Float64, Float64]:
    if len(stamps_s) < 3:
        return places.mean(axis=0), np.zeros(2)
    slope, origin = np.polyfit(stamps_s - at_s, places, 1)
    return origin, slope


def _joined(observations: Observations, parts: list[Int]) -> list[Int]:
    """Join parts of one object: at one place of the world where it is static, else where the motions meet in a gap."""
    frames = [set(observations.frames[rows].tolist()) for rows in parts]
    owner = list(range(len(parts)))
    members = {number: [number] for number in owner}
    for _, first, second in sorted(_pairs(observations, parts)):
        a, b = owner[first], owner[second]
        if a == b or frames[a] & frames[b]:
            continue
        frames[a] |= frames[b]
        members[a] += members.pop(b)
        for number in members[a]:
            owner[number] = a
    return [np.sort(np.concatenate([parts[one] for one in ones])) for ones in members.values()]


def _pairs(observations: Observations, parts: Sequence[Int]) -> Iterator[tuple[float, int, int]]:
    """Yield pairs of parts that may be one object, each with its cost."""
    motions = [_Motion.of(observations[rows]) for rows in parts]
    groups = np.array([observations.groups[rows[0]] for rows in parts], np.int64)
    middles = np.array([one.middle_m for one in motions]).reshape(-1, 2)
    best = [rows[observations.scores[rows].argmax()] for rows in parts]
    boxes = observations.boxes_world[np.array(best, np.int64)]
    tree = cKDTree(middles)
    for first, second in sorted(tree.query_pairs(_MAX_JOIN_M)):
        if groups[first] != groups[second]:
            continue
        a, b = motions[first], motions[second]
        if a.is_static and b.is_static:
            away_m = float(np.linalg.norm(a.middle_m - b.middle_m))
            pair = boxes[first : first + 1], boxes[second : second + 1]
            gap_s = max(a.first_s, b.first_s) - min(a.last_s, b.last_s)
            is_lasting = groups[first] == _VEHICLES or gap_s < _MAX_JOIN_S
            if is_lasting and (
                away_m < _SAME_PLACE_M or paired_iou_bev(*pair)[0] > _SAME_PLACE_IOU
            ):
                yield away_m / 10, first, second
            continue
        before, after = (a, b) if a.last_s < b.first_s else (b, a)
        gap_s = after.first_s - before.last_s
        if not 0 < gap_s <= _MAX_JOIN_S:
            continue
        ahead = before.stop[0] + before.stop[1] * gap_s - after.start[0]
        behind = after.start[0] - after.start[1] * gap_s - before.stop[0]
        away_m = float(min(np.linalg.norm(ahead), np.linalg.norm(behind)))
        limit_m = _NOISE_M[groups[first]] + 0.5 * _CHANGE_M_S[groups[first]] * gap_s
        if away_m < limit_m:
            yield 1 + away_m / limit_m, first, second
