import numpy as np
import pytest

from perception.tracking.single_object.constant_acceleration import (
    ConstantAcceleration,
    NoiseLevels,
)

AUTHOR = NoiseLevels(process=3.0, first=1.0)
STILL = NoiseLevels(process=0.0, first=1.0)


def test_begins_at_rest_where_it_is_put():
    point = ConstantAcceleration.at_rest(np.array([1.0, 2.0, 3.0]), AUTHOR)
    np.testing.assert_array_equal(point.position, [1, 2, 3])
    np.testing.assert_array_equal(point.velocity, [0, 0, 0])
    np.testing.assert_array_equal(point.position_covariance, np.eye(3))


def test_two_measurements_at_once_meet_by_their_variances():
    # (5.16): a place known to 1 m², measured at 3 with 1 m² and at 6 with 3 m².
    point = ConstantAcceleration.at_rest(np.zeros(1), AUTHOR)
    fused = point.corrected(np.array([[3.0], [6.0]]), np.array([1.0, 3.0]))
    precision = 1 + 1 + 1 / 3
    assert fused.position[0] == pytest.approx((3 + 6 / 3) / precision)
    assert fused.position_covariance[0, 0] == pytest.approx(1 / precision)


def test_both_at_once_are_one_after_the_other():
    point = ConstantAcceleration.at_rest(np.zeros(3), AUTHOR).predicted(0.1, AUTHOR)
    positions, variances = np.array([[1.0, 2, 3], [2, 2, 2]]), np.array([1.0, 3.0])
    at_once = point.corrected(positions, variances)
    in_turn = point.corrected(positions[:1], variances[:1]).corrected(positions[1:], variances[1:])
    np.testing.assert_allclose(at_once.states.mean, in_turn.states.mean)
    np.testing.assert_allclose(at_once.states.covariance, in_turn.states.covariance)


def test_finds_place_and_velocity_of_what_accelerates_evenly():
    point = ConstantAcceleration.at_rest(np.zeros(2), STILL)
    for step in range(1, 400):
        time_s = 0.1 * step
        truth = np.array([2.0 * time_s, 0.5 * time_s**2])
        point = point.predicted(0.1, STILL).corrected(truth[None], np.array([1e-4]))
    np.testing.assert_allclose(point.position, truth, atol=0.01)
    np.testing.assert_allclose(point.velocity, [2.0, time_s], atol=0.01)


def test_what_a_step_adds_grows_with_its_time():
    point = ConstantAcceleration.at_rest(np.zeros(1), NoiseLevels(process=3.0, first=0.0))
    assert point.predicted(0.1, AUTHOR).position_covariance[0, 0] == pytest.approx(3.0)
    assert point.predicted(0.2, AUTHOR).position_covariance[0, 0] == pytest.approx(6.0)


def test_no_time_changes_nothing():
    point = ConstantAcceleration.at_rest(np.array([1.0, 2.0, 3.0]), AUTHOR).predicted(0.1, AUTHOR)
    same = point.predicted(0.0, AUTHOR)
    np.testing.assert_array_equal(same.states.mean, point.states.mean)
    np.testing.assert_array_equal(same.states.covariance, point.states.covariance)
