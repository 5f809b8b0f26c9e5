"""Identity measures on sequences that can be counted by hand, and against the reference implementation."""

from dataclasses import replace

import pytest

from perception.evaluation.multi_object.mot_metrics import Identity, identity
from tests.reference import tracking_metrics as naive


def test_a_perfect_tracker(frame_of):
    result = identity([frame_of([3, 4], [8, 9], [[1, 0], [0, 1]])] * 5)
    assert result == Identity(10, 0, 0)
    assert result.idf1 == result.idp == result.idr == 1


def test_an_object_is_given_its_longest_track(frame_of):
    result = identity([frame_of([1], [5], [[1]])] * 3 + [frame_of([1], [6], [[1]])] * 7)
    assert result == Identity(true_positives=7, false_positives=3, false_negatives=3)
    assert result.idf1 == result.idp == result.idr == pytest.approx(0.7)


def test_a_track_is_given_to_one_object_only(frame_of):
    result = identity([frame_of([1], [5], [[1]])] * 4 + [frame_of([2], [5], [[1]])] * 6)
    assert result == Identity(true_positives=6, false_positives=4, false_negatives=4)


def test_identities_maximise_the_sum_of_matches_not_each_one(frame_of):
    # Track 5 meets object 1 five times and object 2 four times; track 6 meets object 1 four times.
    frames = [
        *[frame_of([1], [5], [[1]])] * 5,
        *[frame_of([2], [5], [[1]])] * 4,
        *[frame_of([1], [6], [[1]])] * 4,
    ]
    assert identity(frames).true_positives == 8


def test_all_that_are_near_enough_meet_in_a_frame(frame_of):
    # Both tracks lie on the object; the one that goes on is its own in the shared frames too.
    both, later = frame_of([1], [5, 6], [[0.9, 0.5]]), frame_of([1], [6], [[0.5]])
    assert identity([both, both, later]).true_positives == 3
    assert identity([both, both, later], threshold=0.6).true_positives == 2


def test_frames_of_one_side_only(frame_of):
    result = identity([frame_of([], [5], []), frame_of([1, 2], [], [])])
    assert result == Identity(0, 1, 2)
    assert (result.idf1, result.idp, result.idr) == (0, 0, 0)
    assert identity([]) == Identity()
    assert identity([]).idf1 == 0


def test_sequences_are_combined_by_their_counts(frame_of):
    one = identity([frame_of([1], [5], [[1]])] * 3)
    both = one + identity([frame_of([1], [5], [[0]])] * 2)
    assert both == Identity(true_positives=3, false_positives=2, false_negatives=2)
    assert both.idf1 == pytest.approx(3 / (3 + 1 + 1))
    assert both.idr == pytest.approx(3 / 5)


def test_equals_the_reference(crowd):
    for threshold in (0.5, 0.2):
        assert identity(crowd, threshold) == naive.identity(crowd, threshold)


def test_scores_are_the_same_under_other_names_and_orders_of_frames(crowd):
    changed = [replace(f, truth_ids=-f.truth_ids, track_ids=f.track_ids**2) for f in crowd[::-1]]
    assert identity(changed) == identity(crowd)
