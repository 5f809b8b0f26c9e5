"""Motion of a point: constant acceleration, and the heading of its course."""

import numpy as np
import pytest

from perception.tracking.single_object.config import CourseConfig
from perception.tracking.single_object.point_motion import (
    ConstantAcceleration,
    heading_from_course,
)

PROCESS, INITIAL = 3.0, 1.0  # of the author's code
CONFIG = CourseConfig()
CAR, WALKER = np.array([4.0, 1.8, 1.5]), np.array([0.8, 0.6, 1.8])


def position_covariance(point: ConstantAcceleration) -> np.ndarray:
    axes = len(point.position)
    return point.states.covariance[0, :axes, :axes]


def test_starts_at_rest():
    point = ConstantAcceleration.at_rest(np.array([1.0, 2.0, 3.0]), INITIAL)
    np.testing.assert_array_equal(point.position, [1, 2, 3])
    np.testing.assert_array_equal(point.velocity, [0, 0, 0])
    np.testing.assert_array_equal(position_covariance(point), np.eye(3))


def test_two_measurements_at_once_meet_by_their_variances():
    # (5.16): a position known to 1 m², measured at 3 with 1 m² and at 6 with 3 m².
    point = ConstantAcceleration.at_rest(np.zeros(1), INITIAL)
    fused = point.corrected(np.array([[3.0], [6.0]]), np.array([1.0, 3.0]))
    precision = 1 + 1 + 1 / 3
    assert fused.position[0] == pytest.approx((3 + 6 / 3) / precision)
    assert position_covariance(fused)[0, 0] == pytest.approx(1 / precision)


def test_both_at_once_are_one_after_the_other():
    point = ConstantAcceleration.at_rest(np.zeros(3), INITIAL).predicted(0.1, PROCESS)
    positions, variances = np.array([[1.0, 2, 3], [2, 2, 2]]), np.array([1.0, 3.0])
    at_once = point.corrected(positions, variances)
    in_turn = point.corrected(positions[:1], variances[:1]).corrected(positions[1:], variances[1:])
    np.testing.assert_allclose(at_once.states.mean, in_turn.states.mean)
    np.testing.assert_allclose(at_once.states.covariance, in_turn.states.covariance)


def test_finds_position_and_velocity_under_constant_acceleration():
    point = ConstantAcceleration.at_rest(np.zeros(2), INITIAL)
    for step in range(1, 400):
        time_s = 0.1 * step
        truth = np.array([2.0 * time_s, 0.5 * time_s**2])
        point = point.predicted(0.1, 0.0).corrected(truth[None], np.array([1e-4]))
    np.testing.assert_allclose(point.position, truth, atol=0.01)
    np.testing.assert_allclose(point.velocity, [2.0, time_s], atol=0.01)


def test_what_a_step_adds_grows_with_its_time():
    point = ConstantAcceleration.at_rest(np.zeros(1), 0.0)
    assert position_covariance(point.predicted(0.1, PROCESS))[0, 0] == pytest.approx(3.0)
    assert position_covariance(point.predicted(0.2, PROCESS))[0, 0] == pytest.approx(6.0)


def test_zero_seconds_leave_the_state():
    point = ConstantAcceleration.at_rest(np.array([1.0, 2.0, 3.0]), INITIAL).predicted(0.1, PROCESS)
    same = point.predicted(0.0, PROCESS)
    np.testing.assert_array_equal(same.states.mean, point.states.mean)
    np.testing.assert_array_equal(same.states.covariance, point.states.covariance)


@pytest.mark.parametrize(
    ("size_m", "displacement_m", "last_rad", "expected_rad"),
    [
        pytest.param(CAR, (0.0, 0.5), 0.0, np.pi / 2, id="fast car turns"),
        pytest.param(CAR, (0.0, 0.3), 0.0, 0.0, id="slow car keeps its heading"),
        pytest.param(CAR, (0.3, 0.03), 0.0, 0.0997, id="slow car turns a little"),
        pytest.param(CAR, (-0.3, 0.01), np.pi - 0.01, np.pi - 0.0333, id="across the half turn"),
        pytest.param(CAR, (-0.3, -0.01), np.pi - 0.01, -np.pi + 0.0333, id="and past it"),
        pytest.param(WALKER, (0.0, 0.06), 0.0, np.pi / 2, id="walker turns on the spot"),
        pytest.param(WALKER, (0.0, 0.04), 0.0, 0.0, id="standing walker does not"),
        pytest.param(WALKER, (0.0, 0.0), 1.0, 1.0, id="no displacement"),
    ],
)
def test_heading(size_m, displacement_m, last_rad, expected_rad):
    found = heading_from_course(np.array(displacement_m), 0.1, last_rad, size_m, CONFIG)
    assert found == pytest.approx(expected_rad, abs=1e-3)


def test_slowness_is_a_speed_not_a_distance():
    assert heading_from_course(np.array([0.0, 0.5]), 0.2, 0.0, CAR, CONFIG) == 0.0
    assert heading_from_course(np.array([0.0, 0.5]), 0.1, 0.0, CAR, CONFIG) == pytest.approx(
        np.pi / 2
    )


def test_no_time_keeps_the_heading():
    assert heading_from_course(np.array([0.0, 5.0]), 0.0, 0.3, CAR, CONFIG) == 0.3
