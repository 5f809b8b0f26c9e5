from dataclasses import replace

import numpy as np
import pytest

from perception.obstacles.free_space import PastReturns, VisibilityHistory
from perception.obstacles.moving_clusters import moving_voxels, vote

STEP_RAD = 0.007
AGES_S = np.array([0.5, 1.0, 1.5])
NOWHERE = np.zeros((0, 3), np.float32)


def history(*states, ages_s=AGES_S, gaps_m=None, left=0, visible=10):
    """Build a history from one word a voxel: F free, H hit, L behind a leaver, - unknown; newest first.

    Of `visible` scans that saw a voxel, `left` have a return from it before a beam passed.
    """
    letters = np.array([list(word) for word in states]).T
    gaps = np.zeros(letters.shape, np.float32) if gaps_m is None else np.float32(gaps_m)
    return VisibilityHistory(
        ages_s,
        letters == "F",
        letters == "H",
        letters == "L",
        gaps,
        lambda rows: PastReturns(
            np.broadcast_to(left, len(states))[rows],
            np.full(len(rows), visible),
        ),
    )


def column(x, y, voxels):
    """Voxels over one place."""
    return np.array([[x, y, 0.1 * k] for k in range(voxels)], np.float32)


def test_older_scans_decide_and_the_youngest_where_they_are_blind():
    votes = vote(history("HFF", "FHH", "F--", "H--", "--L", "-FH", "---"))
    assert votes.appeared.tolist() == [True, False, True, False, False, False, False]
    assert votes.persisted.tolist() == [False, True, False, True, False, True, False]
    assert votes.uncovered.tolist() == [False, False, False, False, True, False, False]


def moves(states, voxels=12, before=NOWHERE, **options):
    places = column(5.0, 0.0, voxels)
    word_for_each = [states] * voxels if isinstance(states, str) else states
    return moving_voxels(places, history(*word_for_each, **options), before, STEP_RAD)


@pytest.mark.parametrize(
    ("states", "expected"),
    [("FFF", True), ("HHH", False), ("---", False), ("HFF", False), ("F--", True)],
    ids=["came", "stood", "out of sight", "stopped", "came to light and moves"],
)
def test_an_object_moves_where_its_place_was_empty(states, expected):
    assert moves(states).tolist() == [expected] * 12


def test_a_few_voxels_count_only_beside_what_moved_before():
    assert not moves("FFF", voxels=6).any()
    assert moves("FFF", voxels=6, before=column(5.4, 0.0, 3)).all()
    assert not moves("FFF", voxels=6, before=column(6.0, 0.0, 3)).any()


def test_occluded_voxels_move_with_those_that_appeared():
    assert moves(["FFF"] * 12 + ["---"] * 28, voxels=40).all()


@pytest.mark.parametrize(
    ("gaps_m", "expected"),
    [
        ((1.0, 2.0, 3.0), True),
        ((3.0, 3.0, 3.0), False),
        ((0.3, 0.35, 0.4), False),
        ((3.8, 16.9, 16.0), False),
    ],
    ids=["drives away", "hidden by a passer-by", "hidden by one close to it", "by two in turn"],
)  # fmt: skip
def test_a_leaving_object_differs_from_one_that_was_occluded(gaps_m, expected):
    gaps = np.repeat(np.array(gaps_m)[:, None], 12, axis=1)
    assert moves("LLL", gaps_m=gaps).tolist() == [expected] * 12


@pytest.mark.parametrize(("oldest_m", "expected"), [(5.0, True), (4.9, False)])
def test_the_gap_to_a_leaving_object_may_end_a_little_above_0(oldest_m, expected):
    # 2 m at 0.1 s and 5 m at 0.3 s end at 0.5 m now: 0.25 * 2 m + 0.1 s * 0.3 s / 2 * 2 m/s^2 = 0.53 m are allowed.
    gaps = np.repeat(np.array((2.0, 3.5, oldest_m))[:, None], 12, axis=1)
    ages_s = np.array([0.1, 0.2, 0.3])
    assert moves("LLL", gaps_m=gaps, ages_s=ages_s).tolist() == [expected] * 12


@pytest.mark.parametrize(
    ("left", "expected"),
    [(0, True), (1, True), (2, False)],
    ids=["empty before", "once a leaf", "a fence"],
)
def test_what_returned_between_passing_beams_before_does_not_move(left, expected):
    assert moves("FFF", left=left).tolist() == [expected] * 12
    assert moves("LLL", left=left).tolist() == [expected] * 12


def test_what_moves_already_may_pass_over_static_places():
    beside = column(5.0, 0.2, 3)
    assert moves("FFF", left=2, before=beside).all()
    assert not moves("FFF", left=3, before=beside).any()


def test_only_the_voxels_that_appeared_tell_a_fence():
    left = np.array([0] * 12 + [10] * 10)
    assert moves(["FFF"] * 12 + ["---"] * 10, voxels=22, left=left).all()


@pytest.mark.parametrize(("away_m", "is_one"), [(5.0, False), (25.0, True)])
def test_parts_are_one_cluster_where_the_beams_leave_such_a_gap(away_m, is_one):
    places = np.vstack([column(away_m, 0.0, 12), column(away_m, 0.85, 12)])
    states = history(*["FFF"] * 12, *["---"] * 12)
    moving = moving_voxels(places, states, NOWHERE, beam_step_rad=np.radians(2))
    assert moving.tolist() == [True] * 12 + [is_one] * 12


def test_a_slow_car_s_side_moves_with_its_front():
    places = np.vstack([column(5.0 + 0.25 * k, 0.0, 6) for k in range(16)])
    appeared = ["FFF"] * 60 + ["HHH"] * 36
    assert moving_voxels(places, history(*appeared), NOWHERE, STEP_RAD).all()


def test_a_walker_does_not_make_the_wall_beside_him_move():
    wall = np.vstack([column(5.0 + 0.25 * k, 0.0, 6) for k in range(12)])
    places = np.vstack([wall, column(6.0, 0.3, 14)])
    states = history(*["HHH"] * 72, *["FFF"] * 14)
    assert moving_voxels(places, states, NOWHERE, STEP_RAD).tolist() == [
        *[False] * 72,
        *[True] * 14,
    ]


def test_what_begins_to_move_has_been_observed_often_enough():
    assert not moves("FFF", visible=3).any()
    assert moves("FFF", visible=4).all()
    assert moves("FFF", visible=3, before=column(5.0, 0.2, 3)).all()


def test_what_drives_away_need_not_have_been_observed_often():
    gaps = np.repeat(np.array((1.0, 2.0, 3.0))[:, None], 12, axis=1)
    assert moves("LLL", gaps_m=gaps, visible=3).all()
    assert not moves(["LLL"] * 3 + ["FFF"] * 9, gaps_m=gaps, visible=3).any()


@pytest.mark.parametrize(("voxels", "expected"), [(1, False), (2, True)])
def test_the_second_scan_of_a_drive_needs_voxels_in_proportion_to_its_age(voxels, expected):
    moving = moves("F", voxels=voxels, ages_s=AGES_S[:1] / 5, visible=40)
    assert moving.tolist() == [expected] * voxels


def test_a_walker_moves_as_a_whole_without_the_post_and_the_bush_beside_him():
    walker, leg, post = column(5.0, 0.0, 20), column(4.75, 0.0, 8), column(5.3, 0.0, 8)
    bush = np.vstack([column(5.0, y, 1) for y in (0.25, 0.5, 0.75)])
    states = history(*["FFF"] * 20, *["HFH"] * 8, *["HHH"] * 8, *["HFH"] * 3)
    moving = moving_voxels(np.vstack([walker, leg, post, bush]), states, NOWHERE, STEP_RAD)
    assert moving[:28].all()
    assert not moving[28:36].any()
    assert moving[36:].tolist() == [True, False, False]


def test_without_history_no_voxel_moves():
    empty = np.zeros((0, 12), bool)
    none = replace(history("F" * 12), ages_s=np.zeros(0), was_free=empty, was_hit=empty)
    assert not moving_voxels(column(5, 0, 12), none, NOWHERE, STEP_RAD).any()
