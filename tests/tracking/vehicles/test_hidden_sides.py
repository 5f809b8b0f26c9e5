"""Which sides of a box in the image nearer objects hide."""

import numpy as np
import pytest

from perception.tracking.vehicles.vehicle_table import hidden_sides

_FAR_PX = [100.0, 50.0, 200.0, 100.0]
_RIGHT, _LEFT, _NONE = [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 0]


@pytest.mark.parametrize(
    ("near_px", "near_m", "expected"),
    [
        ([180.0, 40.0, 300.0, 140.0], 12.0, _RIGHT),
        ([214.0, 40.0, 300.0, 140.0], 12.0, _RIGHT),  # the box ends just before
        ([216.0, 40.0, 300.0, 140.0], 12.0, _NONE),
        ([20.0, 40.0, 120.0, 140.0], 12.0, _LEFT),
        ([120.0, 40.0, 180.0, 140.0], 12.0, _NONE),  # a walker amid it
        ([180.0, 40.0, 300.0, 140.0], 19.5, _NONE),  # beside it
        ([180.0, 80.0, 300.0, 140.0], 12.0, _NONE),  # lower than its middle
    ],
)
def test_a_nearer_box_hides_the_side_that_it_covers(near_px, near_m, expected):
    boxes_px = np.array([_FAR_PX, near_px])
    hidden = hidden_sides(boxes_px, np.array([20.0, near_m]))
    np.testing.assert_array_equal(hidden, np.array([expected, _NONE], bool))


def test_of_no_boxes_no_side_is_hidden():
    assert hidden_sides(np.zeros((0, 4)), np.zeros(0)).shape == (0, 4)
