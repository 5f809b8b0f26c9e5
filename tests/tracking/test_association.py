from itertools import permutations

import numpy as np
import pytest

from benchmarks.reference.point_tracker import greedy_nearest_by_loop
from perception.tracking.association import (
    Association,
    assign_greedily,
    assign_hungarian,
    assign_sure_first,
    assign_with_max_cost,
)

BOTH = pytest.mark.parametrize("assign", [assign_hungarian, assign_greedily])


def pairs(association: Association) -> dict[int, int]:
    return dict(zip(association.tracks.tolist(), association.detections.tolist(), strict=True))


def best_by_trial(costs: np.ndarray, is_allowed: np.ndarray) -> tuple[int, float]:
    """Return how many pairs the best of all assignments has, and its cost."""
    tracks, detections = costs.shape
    # Each order of detections, padded by as many "none" as there are tracks, is an assignment.
    columns = [*range(detections), *[-1] * tracks]
    found = []
    for chosen in set(permutations(columns, tracks)):
        kept = [(t, d) for t, d in enumerate(chosen) if d >= 0]
        if all(is_allowed[pair] for pair in kept):
            found.append((-len(kept), sum(costs[pair] for pair in kept)))
    count, cost = min(found)
    return -count, cost


@BOTH
def test_every_row_is_in_a_pair_or_left_over(assign):
    distances = np.random.default_rng(0).uniform(0, 2, (6, 5))
    found = assign(distances, distances < 1)
    assert sorted([*found.tracks, *found.unmatched_tracks]) == list(range(6))
    assert sorted([*found.detections, *found.unmatched_detections]) == list(range(5))
    assert (distances[found.tracks, found.detections] < 1).all()


@BOTH
@pytest.mark.parametrize("shape", [(0, 0), (0, 3), (3, 0)])
def test_costs_without_rows_or_columns_have_no_pairs(assign, shape):
    found = assign(np.zeros(shape), np.zeros(shape, bool))
    assert pairs(found) == {}
    assert found.unmatched_tracks.tolist() == list(range(shape[0]))
    assert found.unmatched_detections.tolist() == list(range(shape[1]))


@BOTH
def test_a_track_with_no_allowed_pair_takes_none_from_others(assign):
    distances = np.array([[0.1, 0.2], [0.3, 0.4], [0.6, 0.5]])
    is_allowed = np.array([[False, False], [True, False], [False, True]])
    found = assign(distances, is_allowed)
    assert pairs(found) == {1: 0, 2: 1}
    assert found.unmatched_tracks.tolist() == [0]


@BOTH
def test_costs_beyond_the_gate_have_no_pairs(assign):
    assert pairs(assign(np.ones((2, 3)), np.zeros((2, 3), bool))) == {}


@BOTH
def test_ties_go_to_the_first(assign):
    assert pairs(assign(np.ones((2, 2)), np.ones((2, 2), bool))) == {0: 0, 1: 1}


@BOTH
def test_costs_of_pairs_that_are_not_allowed_may_be_infinite(assign):
    distances = np.array([[np.inf, 1.0], [np.inf, np.inf]])
    assert pairs(assign(distances, np.isfinite(distances))) == {0: 1}


def test_the_first_track_takes_the_nearest_even_where_it_hurts_the_next():
    distances = np.array([[1.0, 2.0], [1.1, 9.0]])
    assert pairs(assign_greedily(distances, distances < 4)) == {0: 0}
    assert pairs(assign_hungarian(distances, distances < 4)) == {0: 1, 1: 0}


def test_more_pairs_come_before_cheaper_ones():
    costs = np.array([[0.0, 9.0], [9.0, 9.0]])
    is_allowed = np.array([[True, True], [True, False]])
    assert pairs(assign_hungarian(costs, is_allowed)) == {0: 1, 1: 0}


@pytest.mark.parametrize("seed", range(5))
def test_greedy_assignment_equals_the_reference_loop(seed):
    distances = np.random.default_rng(seed).uniform(0, 3, (12, 9)).round(1)  # with ties
    found = assign_greedily(distances, distances <= 0.8)
    assert pairs(found) == greedy_nearest_by_loop(distances, 0.8)


@pytest.mark.parametrize("seed", range(5))
def test_optimal_is_the_best_of_all_trials(seed):
    rng = np.random.default_rng(seed)
    costs, is_allowed = rng.uniform(0, 1, (4, 3)), rng.uniform(size=(4, 3)) < 0.5
    found = assign_hungarian(costs, is_allowed)
    cost = costs[found.tracks, found.detections].sum()
    assert (len(found.tracks), pytest.approx(cost)) == best_by_trial(costs, is_allowed)


def test_a_missed_neighbour_does_not_hand_on_all_others():
    # Each track's own detection costs 1, its neighbour's 8; that of the first is missing.
    costs = np.full((3, 3), 50.0)
    costs[[0, 1, 2], [0, 1, 2]], costs[[0, 1], [1, 2]] = 1.0, 8.0
    seen, is_allowed = costs[:, 1:], np.ones((3, 2), bool)
    assert pairs(assign_with_max_cost(seen, is_allowed, 30.0)) == {1: 0, 2: 1}
    assert pairs(assign_with_max_cost(seen[:1], is_allowed[:1], 30.0)) == {0: 0}
    assert pairs(assign_with_max_cost(seen[:1], is_allowed[:1], 8.0)) == {}
    assert pairs(assign_with_max_cost(seen[:1], ~is_allowed[:1], 30.0)) == {}


def test_pairs_above_the_maximum_cost_stay_unmatched():
    found = assign_with_max_cost(np.array([[1.0, 9.0], [9.0, 9.0]]), np.ones((2, 2), bool), 5.0)
    assert pairs(found) == {0: 0}
    assert found.unmatched_tracks.tolist() == found.unmatched_detections.tolist() == [1]


def test_what_surely_exists_chooses_before_the_others():
    costs, is_allowed = np.array([[2.0, 1.0], [9.0, 3.0]]), np.ones((2, 2), bool)
    # The others would take the nearer track, which is left to what is sure.
    assert pairs(assign_sure_first(costs, is_allowed, 5.0, np.array([True, False]))) == {0: 0, 1: 1}
    assert pairs(assign_sure_first(costs, is_allowed, 5.0, np.array([False, True]))) == {0: 1}
    found = assign_sure_first(costs, is_allowed, 5.0, np.array([False, True]))
    assert (found.unmatched_tracks.tolist(), found.unmatched_detections.tolist()) == ([1], [0])
