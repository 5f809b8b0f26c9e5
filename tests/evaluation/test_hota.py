"""HOTA on sequences that can be counted by hand, and against the reference implementation."""

from dataclasses import fields, replace

import numpy as np
import pytest

from perception.errors import PerceptionError
from perception.evaluation.multi_object.hota import ALPHAS, Hota, hota
from tests.evaluation.conftest import renamed
from tests.faults import fault
from tests.reference import tracking_metrics as naive


def assert_same(a: Hota, b: Hota) -> None:
    for field in fields(Hota):
        np.testing.assert_allclose(
            getattr(a, field.name), getattr(b, field.name), rtol=1e-12, err_msg=field.name
        )


def test_a_perfect_tracker_has_1_everywhere(frame_of):
    result = hota([frame_of([3, 4], [8, 9], [[1, 0], [0, 1]])] * 5)
    for name in ("hota", "det_a", "det_re", "det_pr", "ass_a", "ass_re", "ass_pr", "loc_a"):
        assert (getattr(result, name) == 1).all()
    assert result.true_positives.tolist() == [10] * 19
    assert ALPHAS[[0, -1]].tolist() == [0.05, 0.95]


def test_one_object_followed_by_two_tracks_in_turn(frame_of):
    # Each of 4 true positives: its couple meets 2 times, the object is there 4, the track 2 times.
    result = hota([frame_of([1], [5], [[1]])] * 2 + [frame_of([1], [6], [[1]])] * 2)
    assert result.ass_a.mean() == pytest.approx(2 / (4 + 2 - 2))
    assert result.ass_re.mean() == pytest.approx(2 / 4)
    assert result.ass_pr.mean() == 1
    assert result.hota.mean() == pytest.approx(np.sqrt(0.5))


def test_misses_and_false_boxes(frame_of):
    # 3 true boxes, 2 predicted, of which 1 is true.
    result = hota([frame_of([1, 2], [5], [[1], [0]]), frame_of([1], [6], [[0]])])
    assert result.det_a.mean() == pytest.approx(1 / 4)
    assert result.det_re.mean() == pytest.approx(1 / 3)
    assert result.det_pr.mean() == pytest.approx(1 / 2)
    assert result.ass_a.mean() == pytest.approx(1 / 2)  # the object is there twice, its track once
    assert result.hota.mean() == pytest.approx(np.sqrt(1 / 4 * 1 / 2))


def test_thresholds_up_to_the_similarity_count(frame_of):
    result = hota([frame_of([1], [5], [[0.72]])] * 3)
    assert result.true_positives.tolist() == [3] * 14 + [0] * 5
    assert result.hota.mean() == pytest.approx(14 / 19)
    assert result.loc_a.mean() == pytest.approx((14 * 0.72 + 5) / 19)  # nothing matched: 1


@pytest.mark.parametrize(
    ("similarity", "levels"),
    [(0.15, 3), (0.35, 7), (0.5, 10), (np.nextafter(0.5, 0), 10), (0.4999, 9), (0.95, 19)],
)
def test_a_similarity_of_the_threshold_itself_counts(frame_of, similarity, levels):
    result = hota([frame_of([1], [5], [[similarity]])])
    assert result.true_positives.sum() == levels


def test_it_is_the_mean_of_roots_not_the_root_of_means(frame_of):
    result = hota([frame_of([1], [5], [[0.9]]), frame_of([1], [6], [[0.3]])])
    assert result.hota.mean() == pytest.approx(np.sqrt(result.det_a * result.ass_a).mean())
    assert abs(result.hota.mean() - np.sqrt(result.det_a.mean() * result.ass_a.mean())) > 0.01


def test_who_belongs_together_over_time_is_matched_before_who_is_more_alike(frame_of):
    rival = frame_of([1], [5, 6], [[0.6, 0.8]])
    result = hota([frame_of([1], [5], [[0.9]])] * 9 + [rival])
    # Track 6 would be a true positive at 0.8; track 5, the object's own, is one up to 0.6.
    assert result.true_positives[[10, 12, 15]].tolist() == [10, 9, 9]
    assert result.ass_a[0] == 1


def test_frames_of_one_side_only(frame_of):
    alone = [frame_of([], [5], []), frame_of([1, 2], [], []), frame_of([], [], [])]
    result = hota(alone)
    assert result.false_negatives.tolist() == [2] * 19
    assert result.false_positives.tolist() == [1] * 19
    means = [ratio.mean() for ratio in (result.hota, result.det_a, result.ass_a, result.loc_a)]
    assert means == [0, 0, 0, 1]
    assert_same(hota([]), Hota())


def test_equals_the_reference(crowd):
    assert_same(hota(crowd), naive.hota(crowd))


def test_scores_are_the_same_under_other_names_and_orders_of_rows_and_frames(crowd):
    rng = np.random.default_rng(5)
    changed = renamed([crowd[i] for i in rng.permutation(len(crowd))], rng)
    assert_same(hota(changed), hota(crowd))


def test_truth_and_tracks_are_symmetric(crowd):
    there = hota(crowd)
    back = hota(
        [
            replace(f, truth_ids=f.track_ids, track_ids=f.truth_ids, similarity=f.similarity.T)
            for f in crowd
        ]
    )
    assert there.hota.mean() == pytest.approx(back.hota.mean())
    assert there.det_re.mean() == pytest.approx(back.det_pr.mean())
    assert there.ass_pr.mean() == pytest.approx(back.ass_re.mean())


def test_two_sequences_are_one_whose_names_never_meet(crowd, frame_of):
    other = [frame_of([1, 2], [5, 6], [[0.9, 0.6], [0.1, 0.7]])] * 7
    renamed = [
        replace(f, truth_ids=f.truth_ids + 9999, track_ids=f.track_ids + 9999) for f in other
    ]
    assert_same(hota(crowd) + hota(other), hota([*crowd, *renamed]))
    both = hota(crowd) + hota(other)
    weights = [hota(part).true_positives for part in (crowd, other)]
    means = [hota(part).ass_a for part in (crowd, other)]
    np.testing.assert_allclose(both.ass_a, np.average(means, axis=0, weights=weights))


@pytest.mark.parametrize(
    ("truths", "tracks", "similarity", "where", "found"),
    [
        ([1, 1], [5], [[0], [0]], "truth_ids", "id 1 2 times"),
        ([1], [5, 5], [[0, 0]], "track_ids", "id 5 2 times"),
        ([1], [5], [[1.5]], "similarity", "1.5 to 1.5"),
        ([1], [5], [[np.nan]], "similarity", "nan to nan"),
    ],
)
def test_frames_that_cannot_be(frame_of, truths, tracks, similarity, where, found):
    with fault(PerceptionError, where=f"TrackedFrame.{where}", found=found):
        frame_of(truths, tracks, similarity)
