import numpy as np
import pytest

from perception.kernels.bodies import displacement_evidence

FREE, HIT, HIDDEN = 1, 2, 3
DISTANCES_M = np.array([-1.0, 0.0, 1.0], np.float32)
# A rear and a front, a metre apart each from the middle.
ALONG_M = np.array([-1.0, 0.0, 1.0], np.float32)


def evidence(then, now, low_m=-1.0, high_m=1.0):
    """Return what a scan tells of a metre back, none, and a metre ahead."""
    then, now = np.array(then, np.uint8), np.array(now, np.uint8)
    gains = displacement_evidence(then, now, ALONG_M, DISTANCES_M, low_m, high_m, 0.2)
    return gains.tolist()


# Rows: the samples moved a metre ahead (as if it had come back), where they are, and a metre back.
CAME_A_METRE = [[HIT, HIT, FREE], [HIT, HIT, FREE], [HIT, HIT, HIT]]
RESTED = [[HIT, HIT, FREE], [HIT, HIT, HIT], [FREE, HIT, HIT]]
NOW = [[HIT, HIT, FREE], [HIT, HIT, HIT], [FREE, HIT, HIT]]


def test_ends_that_came_and_left_tell_a_motion():
    # Ahead: its front was free, and its rear has left. Back: its rear was hit where it had not been, its front free.
    assert evidence(CAME_A_METRE, NOW)[::2] == [-2, 2]


def test_ends_that_were_hit_where_they_are_tell_rest():
    assert evidence(RESTED, NOW)[::2] == [-2, -2]


def test_a_body_without_visible_ends_tells_nothing():
    covered = [[HIT, HIT, HIT]] * 3
    assert evidence(covered, covered, -np.inf, np.inf) == [0, 0, 0]


@pytest.mark.parametrize(("state", "gain"), [(FREE, 2), (HIDDEN, 1), (HIT, 0)])
def test_what_is_still_where_the_rear_was_is_something_else(state, gain):
    now = [NOW[0], NOW[1], [state, HIT, HIT]]
    assert evidence(CAME_A_METRE, now)[2] == gain


def test_hidden_places_tell_nothing():
    hidden = [[HIDDEN] * 3] * 3
    assert evidence(hidden, NOW) == [0, 0, 0]
