"""Which detection belongs to which track."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class Association:
    """Pairs of T tracks and D detections, and what is left of both.

    Attributes:
        tracks: (P,) row of the track of each pair.
        detections: (P,) row of the detection of each pair.
        unmatched_tracks: rows of tracks without a detection.
        unmatched_detections: rows of detections without a track.
    """

    tracks: Int
    detections: Int
    unmatched_tracks: Int
    unmatched_detections: Int


def assign_hungarian(costs: Float64, is_allowed: Bool) -> Association:
    """Match as many allowed pairs of (T, D) as there can be, at the least sum of costs.

    Args:
        costs: (T, D) of each pair, 0 or more.
        is_allowed: (T, D) which pairs passed the gate.
    """
    # One forbidden pair costs more than all allowed ones together.
    forbidden = 1.0 + 2.0 * min(costs.shape) * float(costs[is_allowed].max(initial=0.0))
    tracks, detections = linear_sum_assignment(np.where(is_allowed, costs, forbidden))
    kept = is_allowed[tracks, detections]
    return _association(tracks[kept], detections[kept], costs.shape)


def assign_with_max_cost(costs: Float64, is_allowed: Bool, max_cost: float) -> Association:
    """Match allowed pairs of (T, D) at the least sum of costs, where each one unmatched costs something, too.

    What is hidden or missed leaves its track without a detection: to match as many as there can be would
    hand on the neighbour's instead, and the next one's to the neighbour.

    Args:
        costs: (T, D) of each pair.
        is_allowed: (T, D) which pairs passed the gate.
        max_cost: cost of a pair from which on both rather stay alone.
    """
    is_worthwhile = is_allowed & (costs < max_cost)
    tracks, detections = linear_sum_assignment(np.where(is_worthwhile, costs, max_cost))
    kept = is_worthwhile[tracks, detections]
    return _association(tracks[kept], detections[kept], costs.shape)


def assign_greedily(distances: Float64, is_allowed: Bool) -> Association:
    """Let each track, in order, take the nearest detection in its gate that no track before it took.

    Gating and nearest neighbour of the thesis (5.2.2, Data Association).
    """
    rows, columns = np.nonzero(is_allowed)
    nearest_first = np.lexsort((distances[rows, columns], rows))
    # What one track takes bears on all later ones: only this walk over the allowed pairs is in turn.
    taken: dict[int, int] = {}
    is_matched: set[int] = set()
    for track, detection in zip(
        rows[nearest_first].tolist(), columns[nearest_first].tolist(), strict=True
    ):
        if track not in is_matched and detection not in taken:
            taken[detection] = track
            is_matched.add(track)
    detections, tracks = np.array(list(taken.items()), np.int64).reshape(-1, 2).T
    return _association(tracks, detections, distances.shape)


def _association(tracks: Int, detections: Int, shape: tuple[int, ...]) -> Association:
    return Association(tracks, detections, _others(tracks, shape[0]), _others(detections, shape[1]))


def _others(rows: Int, count: int) -> Int:
    is_left = np.ones(count, bool)
    is_left[rows] = False
    return np.flatnonzero(is_left)
