import numpy as np
import pytest

from perception.tracking.single_object.config import PointMeanShiftConfig
from perception.tracking.single_object.localizer import Window, mean_shift_3d

CAR = np.array([4.0, 2.0])


def window_at(x: float, y: float, yaw_rad: float = 0.0) -> Window:
    return Window(np.array([x, y, 0.0]), CAR, yaw_rad)


def test_a_window_contains_points_at_any_height():
    turned = window_at(1.0, 1.0, np.pi / 2)
    points = np.array([[1, 2.9, 9], [1, 3.1, 0], [1.9, 1, -9], [2.1, 1, 0]])
    np.testing.assert_array_equal(turned.contains(points), [True, False, True, False])
    np.testing.assert_array_equal(turned.scaled(2).contains(points), [True] * 4)


def test_one_shift_leads_to_the_mean_not_away_from_it():
    # (5.11), (5.12): the mean of the points in the window, by hand.
    points = np.array([[1.0, 0, 0], [1.5, 0.5, 1], [50, 0, 0]])
    found = mean_shift_3d(points, window_at(0, 0), PointMeanShiftConfig(max_iterations=1))
    np.testing.assert_allclose(found[-1].position_m, [1.25, 0.25, 0.5])
    assert len(found) == 2
    np.testing.assert_array_equal(found[0].position_m, [0, 0, 0])


def test_shifts_until_the_object_lies_within(rng):
    car = rng.uniform((0.5, -0.2, 0), (4.5, 1.8, 1.5), (800, 3))
    found = mean_shift_3d(
        car, window_at(0, 0), PointMeanShiftConfig(max_iterations=10, tolerance_m=0.01)
    )
    np.testing.assert_allclose(found[-1].position_m, car.mean(axis=0), atol=0.05)


def test_stops_after_as_many_shifts_as_allowed_and_below_the_tolerance(rng):
    car = rng.uniform((0.5, -0.2, 0), (4.5, 1.8, 1.5), (800, 3))
    positions = [
        mean_shift_3d(car, window_at(0, 0), PointMeanShiftConfig(max_iterations=count))[
            -1
        ].position_m
        for count in range(1, 12)
    ]
    shifts_m = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    assert shifts_m[0] > 0.05
    last = np.flatnonzero(shifts_m < 0.05)[0]
    np.testing.assert_array_equal(shifts_m[last + 1 :], 0)


def test_the_mean_is_weighted(rng):
    points = np.array([[-1.0, 0, 0], [1.0, 0, 0]])
    found = mean_shift_3d(
        points, window_at(0, 0), PointMeanShiftConfig(max_iterations=1), np.array([1.0, 3.0])
    )
    np.testing.assert_allclose(found[-1].position_m, [0.5, 0, 0])


@pytest.mark.parametrize(
    ("points", "weights"),
    [(np.zeros((0, 3)), None), (np.full((3, 3), 9.0), None), (np.zeros((2, 3)), np.zeros(2))],
)
def test_an_empty_window_stays_in_place(points, weights):
    initial = window_at(0, 0)
    assert mean_shift_3d(points, initial, PointMeanShiftConfig(), weights) == (initial,)


def test_points_without_a_number_are_left_out():
    points = np.array([[np.nan, 0, 0], [1.0, 0.0, 0.0]])
    np.testing.assert_allclose(
        mean_shift_3d(points, window_at(0, 0), PointMeanShiftConfig())[-1].position_m, [1, 0, 0]
    )


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(2)
