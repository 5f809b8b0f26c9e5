"""Association of detections with tracks."""

from dataclasses import dataclass

import numpy as np

from perception.kernels.assignment import minimum_cost_pairs
from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class Association:
    """Pairs of T tracks and D detections, and the unmatched rest of both.

    Attributes:
        tracks: (P,) row of the track of each pair.
        detections: (P,) row of the detection of each pair.
        unmatched_tracks: Rows of tracks without a detection.
        unmatched_detections: Rows of detections without a track.
    """

    tracks: Int
    detections: Int
    unmatched_tracks: Int
    unmatched_detections: Int


def assign_hungarian(costs: Float64, is_allowed: Bool) -> Association:
    """Match the maximum number of allowed pairs at the minimum sum of costs (Hungarian method).

    Args:
        costs: (T, D) cost of each pair, 0 or more.
        is_allowed: (T, D) whether a pair passed the gate.
    """
    # One forbidden pair costs more than all allowed ones together.
    forbidden = 1.0 + 2.0 * min(costs.shape) * float(costs[is_allowed].max(initial=0.0))
    return _associated(costs, is_allowed, forbidden)


def assign_with_max_cost(costs: Float64, is_allowed: Bool, max_cost: float) -> Association:
    """Match allowed pairs at the minimum sum of costs, where an unmatched pair has a cost, too.

    An object that is hidden or missed leaves its track without a detection: to match the maximum number of pairs would
    give it the neighbour's detection, and the neighbour the next one's.

    Args:
        costs: (T, D) cost of each pair.
        is_allowed: (T, D) whether a pair passed the gate.
        max_cost: Cost of a pair at and above which both stay unmatched.
    """
    return _associated(costs, is_allowed & (costs < max_cost), max_cost)


def assign_sure_first(
    costs: Float64, is_allowed: Bool, max_cost: float, is_sure: Bool
) -> Association:
    """Match as `assign_with_max_cost`: the detections that surely exist with all tracks, others with those that are left.

    Args:
        costs: (T, D) cost of each pair.
        is_allowed: (T, D) whether a pair passed the gate.
        max_cost: Cost of a pair at and above which both stay unmatched.
        is_sure: (D,) whether a detection surely exists.
    """
    track_of, free = np.full(costs.shape[1], -1), np.arange(costs.shape[0])
    for chosen in (np.flatnonzero(is_sure), np.flatnonzero(~is_sure)):
        both = np.ix_(free, chosen)
        pairs = assign_with_max_cost(costs[both], is_allowed[both], max_cost)
        track_of[chosen[pairs.detections]] = free[pairs.tracks]
        free = free[pairs.unmatched_tracks]
    detections = np.flatnonzero(track_of >= 0)
    return _association(track_of[detections], detections, costs.shape)


def assign_greedily(distances: Float64, is_allowed: Bool) -> Association:
    """Match each track, in order, with the nearest detection in its gate that is not matched yet.

    This is the gating and nearest neighbour of the thesis (5.2.2, Data Association).

    Args:
        distances: (T, D) distance of each pair.
        is_allowed: (T, D) whether a pair passed the gate.
    """
    rows, columns = np.nonzero(is_allowed)
    nearest_first = np.lexsort((distances[rows, columns], rows))
    # A match excludes pairs of all later tracks: only this loop over the allowed pairs is sequential.
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


def _associated(costs: Float64, is_allowed: Bool, other_cost: float) -> Association:
    """Match allowed pairs at the minimum sum of costs, where all others have one cost; most rows and columns have no other."""
    rows, columns = (np.flatnonzero(is_allowed.any(axis=axis)) for axis in (1, 0))
    is_pair = is_allowed[np.ix_(rows, columns)]
    of_rows, of_columns = minimum_cost_pairs(
        np.where(is_pair, costs[np.ix_(rows, columns)], other_cost)
    )
    kept = is_pair[of_rows, of_columns]
    return _association(rows[of_rows[kept]], columns[of_columns[kept]], costs.shape)


def _association(tracks: Int, detections: Int, shape: tuple[int, ...]) -> Association:
    return Association(
        tracks,
        detections,
        unmatched_tracks=np.delete(np.arange(shape[0]), tracks),
        unmatched_detections=np.delete(np.arange(shape[1]), detections),
    )
