"""CLEAR on sequences that can be counted by hand, and against the reference implementation."""

from dataclasses import asdict

import numpy as np
import pytest

from perception.errors import PerceptionError
from perception.evaluation.multi_object.clear import Clear, clear
from perception.evaluation.multi_object.sequence import TrackedFrame
from tests.evaluation.conftest import renamed
from tests.faults import fault
from tests.reference import tracking_metrics as naive


def test_a_perfect_tracker(frame_of):
    result = clear([frame_of([3, 4], [8, 9], [[1, 0], [0, 1]])] * 5)
    assert result == Clear(true_positives=10, mostly_tracked=2, similarity_sum=10.0)
    assert result.mota == result.moda == result.smota == result.motp == 1
    assert (result.false_positives, result.false_negatives) == (0, 0)


def test_the_ratios(frame_of):
    frames = [
        frame_of([1, 2], [5, 6], [[0.9, 0], [0, 0.6]]),
        frame_of([1, 2], [7, 8], [[0.7, 0], [0, 0.4]]),  # a switch, a miss and a false box
    ]
    result = clear(frames)
    assert (result.true_positives, result.false_positives, result.false_negatives) == (3, 1, 1)
    assert result.id_switches == 1
    assert result.mota == pytest.approx((3 - 1 - 1) / 4)
    assert result.moda == pytest.approx((3 - 1) / 4)
    assert result.smota == pytest.approx((0.9 + 0.6 + 0.7 - 1 - 1) / 4)
    assert result.motp == pytest.approx((0.9 + 0.6 + 0.7) / 3)


@pytest.mark.parametrize(
    ("similarity", "found"), [(0.5, 1), (np.nextafter(0.5, 0), 1), (0.4999, 0)]
)
def test_the_threshold_itself_is_enough(frame_of, similarity, found):
    assert clear([frame_of([1], [5], [[similarity]])]).true_positives == found
    assert clear([frame_of([1], [5], [[similarity]])], threshold=0.3).true_positives == 1


def test_who_was_matched_stays_so_against_one_more_alike(frame_of):
    begin = frame_of([1], [5], [[0.9]])
    stays = clear([begin, frame_of([1], [5, 6], [[0.55, 0.95]])])
    assert (stays.id_switches, stays.motp) == (0, pytest.approx((0.9 + 0.55) / 2))
    leaves = clear([begin, frame_of([1], [5, 6], [[0.45, 0.95]])])
    assert (leaves.id_switches, leaves.motp) == (1, pytest.approx((0.9 + 0.95) / 2))


def test_a_switch_is_counted_from_the_last_track_however_long_ago(frame_of):
    here, gone = frame_of([1], [5], [[1]]), frame_of([1], [9], [[0]])
    again, other = frame_of([1], [5], [[1]]), frame_of([1], [6], [[1]])
    assert clear([here, *[gone] * 20, again]).id_switches == 0
    assert clear([here, *[gone] * 20, other]).id_switches == 1
    assert clear([here, other, here]).id_switches == 2
    # A track that goes on to another object is no switch of that one.
    assert clear([here, frame_of([2], [5], [[1]])]).id_switches == 0


def test_found_again_after_a_frame_without_is_one_fragment(frame_of):
    found, missed = frame_of([1], [5], [[1]]), frame_of([1], [9], [[0]])
    assert clear([missed, found, found]).fragmentations == 0
    assert clear([found, missed, missed, found, missed, found]).fragmentations == 2
    # An object that is away for a frame is not found in it either.
    assert clear([found, frame_of([2], [9], [[0]]), found]).fragmentations == 1


@pytest.mark.parametrize("one_side", [([1], []), ([], [5])], ids=["no track", "no truth"])
def test_frames_of_one_side_count_but_leave_the_memory_alone(frame_of, one_side):
    begin, empty = frame_of([1], [5], [[0.9]]), frame_of(*one_side, [])
    result = clear([begin, empty, frame_of([1], [5, 6], [[0.55, 0.95]])])
    assert (result.fragmentations, result.id_switches) == (0, 0)
    assert result.false_negatives == len(one_side[0])
    assert result.false_positives == len(one_side[1]) + 1
    assert clear([begin, empty, begin]).fragmentations == 0


def test_memory_of_the_frame_before_ends_with_a_frame_of_both_sides(frame_of):
    begin, between = frame_of([1], [5], [[0.9]]), frame_of([2], [9], [[0]])
    result = clear([begin, between, frame_of([1], [5, 6], [[0.55, 0.95]])])
    assert result.id_switches == 1


@pytest.mark.parametrize(
    ("found", "expected"), [(9, "MT"), (8, "PT"), (2, "PT"), (1, "ML"), (0, "ML")]
)
def test_mostly_tracked_is_more_than_80_percent_of_its_frames(frame_of, found, expected):
    frames = [frame_of([1], [5], [[float(i < found)]]) for i in range(10)]
    result = clear(frames)
    counts = (result.mostly_tracked, result.partly_tracked, result.mostly_lost)
    assert dict(zip(("MT", "PT", "ML"), counts, strict=True))[expected] == sum(counts) == 1


def test_without_truth_ratios_are_0_but_counts_enter_the_sum(frame_of):
    sky = clear([frame_of([], [5, 6], [])] * 3)
    assert (sky.mota, sky.motp, sky.false_positives) == (0, 0, 6)
    both = sky + clear([frame_of([1], [5], [[0.8]])] * 12)
    assert both.mota == pytest.approx((12 - 6) / 12)
    assert both.motp == pytest.approx(0.8)
    assert clear([]) == Clear()


def test_without_tracks_all_is_lost(frame_of):
    result = clear([frame_of([1, 2], [], [])] * 3)
    assert result == Clear(false_negatives=6, mostly_lost=2)
    assert result.mota == 0


def test_equals_the_reference(crowd):
    for threshold in (0.5, 0.2):
        assert asdict(clear(crowd, threshold)) == pytest.approx(
            asdict(naive.clear(crowd, threshold))
        )


def test_scores_are_the_same_under_other_names_and_orders_of_rows(crowd):
    changed = renamed(crowd, np.random.default_rng(5))
    assert asdict(clear(changed)) == pytest.approx(asdict(clear(crowd)))


def test_the_counts_of_a_sequence_add_up(crowd):
    result = clear(crowd)
    objects = np.unique(np.concatenate([frame.truth_ids for frame in crowd]))
    assert result.mostly_tracked + result.partly_tracked + result.mostly_lost == len(objects)
    boxes = sum(len(frame.truth_ids) for frame in crowd)
    assert result.true_positives + result.false_negatives == boxes
    assert result.mota <= result.moda <= 1


def test_a_similarity_of_another_shape_is_an_error():
    with fault(
        PerceptionError,
        where="TrackedFrame.similarity",
        expected="shape (1, 2)",
        found="shape (2, 1)",
    ):
        TrackedFrame(np.array([1]), np.array([5, 6]), np.ones((2, 1)))
