"""Intervals of boxes: drawn from their own uncertainty they hold 90 %, and a box of another object counts apart."""

from dataclasses import replace

import numpy as np
import pytest

from perception.evaluation.intervals import BoxIntervals, box_intervals
from perception.types import Boxes3D
from tests.known_result import VEHICLES

ROWS = np.array([0, 1])
TRUE = Boxes3D(
    np.array([[10.0, 2.0, -1.7], [30.0, 2.0, -1.7]]), np.tile([4.2, 1.8, 1.5], (2, 1)), np.zeros(2)
)
TYPES = np.array(["Car", "Van"])


def compared(true, vehicles=VEHICLES):
    return box_intervals(vehicles, ROWS, true, TYPES)


def test_errors_are_in_standard_deviations():
    # Deviations 0.2 and 0.1 m of the centre, 0.4, 0.1 and 0.1 m of the size, 0.05 rad of the axis.
    off = replace(
        TRUE,
        bottom_m=TRUE.bottom_m + np.array([0.2, 0.2, 0]),
        size_m=TRUE.size_m + np.array([0.4, -0.2, 0.3]),
    )
    found = compared(replace(off, yaw_rad=np.array([np.pi + 0.1, 0.0])))
    assert len(found) == 1  # The other has no box.
    assert found.center_spread[0] == pytest.approx(1 + 4)
    np.testing.assert_allclose(found.size_off, [[1, 2, 3]])
    assert found.axis_off[0] == pytest.approx(2)
    assert found.is_reversed.tolist() == [True]
    assert found.reversal.tolist() == [0.1]


@pytest.mark.parametrize(("ratio", "expected"), [(1.0, 0.9), (0.5, 0.59), (2.0, 0.999)])
def test_shares_tell_deviations_that_are_too_small_or_too_large(ratio, expected):
    random, held = np.random.default_rng(0), []
    deviations = VEHICLES.box_deviations
    stated = replace(
        VEHICLES,
        covariances=ratio**2 * VEHICLES.covariances,
        box_deviations=replace(
            deviations, size_m=ratio * deviations.size_m, yaw_rad=ratio * deviations.yaw_rad
        ),
    )
    for _ in range(1000):
        errors = random.normal(0, [0.4, 0.1, 0.1, 0.05], (2, 4))
        true = replace(TRUE, size_m=TRUE.size_m + errors[:, :3], yaw_rad=errors[:, 3])
        held.append(compared(true, stated))
    found = BoxIntervals.concatenate(held).summary()
    np.testing.assert_allclose([found.length, found.width, found.axis], expected, atol=0.03)
    assert (found.boxes, found.reversed, found.reversal) == (1000, 0, pytest.approx(0.1))


def test_a_box_that_does_not_touch_the_true_one_is_that_of_another():
    away = replace(TRUE, bottom_m=TRUE.bottom_m + np.array([6.0, 0, 0]))
    found = BoxIntervals.concatenate([compared(away), compared(TRUE)]).summary()
    assert (found.boxes, found.apart, found.center) == (2, 0.5, 1.0)
