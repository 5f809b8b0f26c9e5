import numpy as np
import pytest

from perception.obstacles.free_space import VisibilityHistory
from perception.obstacles.moving_clusters import BodiesBefore, moving_voxels
from perception.obstacles.range_image import Visibility

STEP_RAD = 0.007
AGES_S = np.array([0.5, 1.0, 1.5])
NOWHERE = np.zeros((0, 3), np.float32)


STATES = {
    "-": Visibility.UNKNOWN,
    "F": Visibility.FREE,
    "H": Visibility.HIT,
    "L": Visibility.UNCOVERED,
}


def history(*words, ages_s=AGES_S, gaps_m=None):
    """Build a history from one word a voxel: F free, H hit, L behind a leaver, - unknown; newest first."""
    states = np.array([[STATES[letter] for letter in word] for word in words], np.uint8).T.copy()
    gaps = np.zeros(states.shape, np.float32) if gaps_m is None else np.float32(gaps_m)
    return VisibilityHistory(ages_s, states, gaps)


def column(x, y, voxels):
    """Voxels over one place."""
    return np.array([[x, y, 0.1 * k] for k in range(voxels)], np.float32)


def test_older_scans_decide_and_the_youngest_where_they_are_blind():
    seen = history("HFF", "FHH", "F--", "H--", "--L", "-FH", "---")
    assert seen.appeared.tolist() == [True, False, True, False, False, False, False]
    assert seen.persisted.tolist() == [False, True, False, True, False, True, False]
    assert seen.uncovered.tolist() == [False, False, False, False, True, False, False]


def moves(states, voxels=12, before=NOWHERE, **options):
    places = column(5.0, 0.0, voxels)
    word_for_each = [states] * voxels if isinstance(states, str) else states
    bodies = BodiesBefore.at(places, before)
    return moving_voxels(places, history(*word_for_each, **options), bodies, STEP_RAD)


@pytest.mark.parametrize(
    ("states", "expected"),
    [("FFF", True), ("HHH", False), ("---", False), ("HFF", False), ("FF-", True)],
    ids=["came", "stood", "out of sight", "stopped", "came to light and moves"],
)
def test_an_object_moves_where_its_place_was_empty(states, expected):
    assert moves(states).tolist() == [expected] * 12


def test_a_few_voxels_count_only_beside_what_moved_before():
    assert not moves("FFF", voxels=6).any()
    assert moves("FFF", voxels=6, before=column(5.4, 0.0, 3)).all()
    assert not moves("FFF", voxels=6, before=column(7.1, 0.0, 3)).any()


def test_occluded_voxels_move_with_those_that_appeared():
    assert moves(["FFF"] * 12 + ["---"] * 28, voxels=40).all()


@pytest.mark.parametrize(
    ("gaps_m", "expected"),
    [
        ((1.0, 2.0, 3.0), True),
        ((3.0, 3.0, 3.0), False),
        ((0.3, 0.35, 0.4), False),
        ((3.8, 16.9, 16.0), False),
        ((3.3, 3.4, 9.0), False),
    ],
    ids=["drives away", "hidden by a passer-by", "hidden by one close to it", "by two in turn", "by another before"],
)  # fmt: skip
def test_a_leaving_object_differs_from_one_that_was_occluded(gaps_m, expected):
    gaps = np.repeat(np.array(gaps_m)[:, None], 12, axis=1)
    assert moves("LLL", gaps_m=gaps).tolist() == [expected] * 12


@pytest.mark.parametrize(("oldest_m", "expected"), [(5.2, True), (5.1, False)])
def test_the_gap_to_a_leaving_object_may_end_a_little_above_0(oldest_m, expected):
    # 2 m at 0.1 s and 5.2 m at 0.3 s end at 0.4 m now: 0.2 m * 0.4 s / 0.2 s + 0.1 s * 0.3 s / 2 * 2 m/s^2 = 0.43 m are
    # allowed.
    gaps = np.repeat(np.array((2.0, 3.5, oldest_m))[:, None], 12, axis=1)
    ages_s = np.array([0.1, 0.2, 0.3])
    assert moves("LLL", gaps_m=gaps, ages_s=ages_s).tolist() == [expected] * 12


@pytest.mark.parametrize(
    ("states", "before", "expected"),
    [
        (["---"] * 12, 12, True),
        (["---"] * 12, 25, False),
        (["---"] * 12, 5, False),
        (["---"] * 11 + ["HHH"], 12, True),
        (["---"] * 10 + ["HHH"] * 2, 12, False),
    ],
    ids=["hidden", "larger before", "smaller before", "one place was hit", "two were hit"],
)
def test_a_cluster_goes_on_as_the_body_that_it_was_where_no_scan_contradicts(
    states, before, expected
):
    assert moves(states, before=column(5.6, 0.0, before)).tolist() == [expected] * 12


def test_of_two_clusters_near_a_body_one_goes_on():
    places = np.vstack([column(5.0, 0.0, 12), column(5.0, 1.0, 14)])
    before = BodiesBefore.at(places, column(5.0, 0.5, 12))
    states = history(*["---"] * 26)
    assert moving_voxels(places, states, before, STEP_RAD).tolist() == [False] * 12 + [True] * 14


@pytest.mark.parametrize(("away_m", "is_one"), [(5.0, False), (25.0, True)])
def test_parts_are_one_cluster_where_the_beams_leave_such_a_gap(away_m, is_one):
    places = np.vstack([column(away_m, 0.0, 12), column(away_m, 0.85, 12)])
    states = history(*["FFF"] * 12, *["---"] * 12)
    moving = moving_voxels(
        places, states, BodiesBefore.at(places, NOWHERE), beam_step_rad=np.radians(2)
    )
    assert moving.tolist() == [True] * 12 + [is_one] * 12


def test_a_slow_car_s_side_moves_with_its_front():
    places = np.vstack([column(5.0 + 0.25 * k, 0.0, 6) for k in range(16)])
    appeared = ["FFF"] * 60 + ["HHH"] * 36
    assert moving_voxels(
        places, history(*appeared), BodiesBefore.at(places, NOWHERE), STEP_RAD
    ).all()


def test_a_walker_does_not_make_the_wall_beside_him_move():
    wall = np.vstack([column(5.0 + 0.25 * k, 0.0, 6) for k in range(12)])
    places = np.vstack([wall, column(6.0, 0.3, 14)])
    states = history(*["HHH"] * 72, *["FFF"] * 14)
    assert moving_voxels(places, states, BodiesBefore.at(places, NOWHERE), STEP_RAD).tolist() == [
        *[False] * 72,
        *[True] * 14,
    ]


def test_what_begins_to_move_has_been_observed_often_enough():
    assert not moves("F--").any()
    assert moves("F--", voxels=20).all()
    assert moves("F--", before=column(5.0, 0.2, 3)).all()


@pytest.mark.parametrize(("hidden", "expected"), [(14, False), (13, True)])
def test_the_second_scan_of_a_drive_decides_by_fewer_voxels(hidden, expected):
    # Of 28 that none of the older scans tells of, 15 are enough.
    states = ["F"] * (28 - hidden) + ["-"] * hidden
    assert moves(states, voxels=28, ages_s=AGES_S[:1] / 5).tolist() == [expected] * 28


def test_a_walker_moves_as_a_whole_without_the_post_and_the_bush_beside_him():
    walker, post = column(5.0, 0.0, 20), column(4.75, 0.0, 8)
    bush = np.vstack([column(5.0, y, 2) for y in (0.25, 0.5, 0.75)])
    states = history(*["FFF"] * 20, *["HHH"] * 5, *["---"] * 3, *["HHH", "---"] * 3)
    places = np.vstack([walker, post, bush])
    moving = moving_voxels(places, states, BodiesBefore.at(places, NOWHERE), STEP_RAD)
    assert moving[:20].all()
    # A leg that was hidden before the post moves with him.
    assert moving[20:28].tolist() == [False] * 5 + [True] * 3
    assert moving[28:].tolist() == [False, True] + [False] * 4


def test_without_history_no_voxel_moves():
    none = VisibilityHistory(np.zeros(0), np.zeros((0, 12), np.uint8), np.zeros((0, 12)))
    places = column(5, 0, 12)
    still = BodiesBefore.at(places, NOWHERE)
    assert not moving_voxels(places, none, still, STEP_RAD).any()
