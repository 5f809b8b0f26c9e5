"""Near sides of vehicles at their returns: equal to a plain reference, and what is moved by how much."""

import numpy as np
import pytest

from perception.detection.bev.boxes import DEVIATIONS, BevDetections
from perception.detection.bev.near_sides import fit_near_sides
from perception.kernels.bev import near_edges
from perception.types import Boxes3D

LOW_M, MARGIN_M, MIN_RETURNS = 0.25, 0.35, 8


def found_at(*columns: tuple[float, ...]) -> BevDetections:
    """Return objects of given x, y, bottom, length, width, height, heading."""
    rows, count = np.array(columns, float).reshape(-1, 7), len(columns)
    boxes = Boxes3D(rows[:, :3], rows[:, 3:6], rows[:, 6])
    numbers = np.zeros(count, np.int64), np.full(count, 0.5)
    return BevDetections(boxes, *numbers, np.full((count, DEVIATIONS), 0.1), np.zeros(count))


def returns_of(x_m: np.ndarray, y_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points at given places, and their heights above the ground."""
    points = np.column_stack([x_m, y_m, np.zeros(len(x_m)), np.zeros(len(x_m))])
    return points.astype(np.float32), np.full(len(x_m), 0.8, np.float32)


def test_edges_are_those_of_the_reference():
    rng = np.random.default_rng(0)
    points = rng.uniform((-20, -20, 0, 0), (20, 20, 0, 1), (20_000, 4)).astype(np.float32)
    heights_m = rng.uniform(0, 2.5, len(points)).astype(np.float32)
    boxes = np.column_stack(
        [
            rng.uniform(-18, 18, (40, 2)), rng.normal(0, 0.05, 40), rng.uniform(3, 12, 40),
            rng.uniform(1.5, 2.5, 40), rng.uniform(1.2, 2.2, 40), rng.uniform(-4, 4, 40),
        ]
    )  # fmt: skip
    edges_m = near_edges(points, heights_m, boxes, LOW_M, MARGIN_M, MIN_RETURNS)
    for box, edges in zip(boxes, edges_m, strict=True):
        axes = np.array([[np.cos(box[6]), np.sin(box[6])], [-np.sin(box[6]), np.cos(box[6])]])
        places_m, sensor_m = (points[:, :2] - box[:2]) @ axes.T, -axes @ box[:2]
        is_in = (np.abs(places_m) < box[3:5] / 2 + MARGIN_M).all(axis=1)
        is_in &= (heights_m > LOW_M) & (heights_m < box[2] + box[5] + 0.1)
        towards_m = np.sort(places_m[is_in] * np.sign(sensor_m), axis=0)
        expected = towards_m[int(0.97 * (is_in.sum() - 1))]
        expected[np.abs(sensor_m) < 0.15 * np.hypot(*box[:2])] = np.nan
        assert edges == pytest.approx(expected, nan_ok=True)
    assert 0 < np.isnan(edges_m).sum() < edges_m.size / 2
    assert near_edges(points, heights_m, boxes[:0], LOW_M, MARGIN_M, MIN_RETURNS).shape == (0, 2)


def test_a_near_side_is_moved_to_its_returns_and_the_far_one_by_half():
    rear = returns_of(np.full(40, 10.0), np.linspace(-0.9, 0.9, 40))
    car = found_at((12.4, 0.0, 0.0, 4.4, 1.8, 1.5, 0.0))  # from 10.2 to 14.6 m
    fitted = fit_near_sides(car, np.array([True]), *rear).boxes
    near_m = fitted.bottom_m[0, 0] - fitted.size_m[0, 0] / 2
    far_m = fitted.bottom_m[0, 0] + fitted.size_m[0, 0] / 2
    assert (near_m, far_m) == pytest.approx((10.0, 14.5), abs=1e-6)
    # Its sides are seen at a grazing angle.
    assert fitted.bottom_m[0, 1] == 0
    assert fitted.size_m[0, 1:].tolist() == [1.8, 1.5]


def test_a_side_moves_no_farther_than_the_network_may_err():
    rear = returns_of(np.full(40, 10.0), np.linspace(-0.9, 0.9, 40))
    car = found_at((11.5, 0.0, 0.0, 4.4, 1.8, 1.5, np.pi))  # its front, from 9.3 m
    fitted = fit_near_sides(car, np.array([True]), *rear).boxes
    assert fitted.bottom_m[0, 0] - fitted.size_m[0, 0] / 2 == pytest.approx(9.65)


@pytest.mark.parametrize("returns", [7, 40])
def test_people_and_vehicles_of_few_returns_stay(returns):
    points = returns_of(np.full(returns, 10.0), np.linspace(-0.9, 0.9, returns))
    found = found_at((12.4, 0.0, 0.0, 4.4, 1.8, 1.5, 0.0))
    fitted = fit_near_sides(found, np.array([returns < 8]), *points).boxes
    assert np.array_equal(fitted.bottom_m, found.boxes.bottom_m)
    assert np.array_equal(fitted.size_m, found.boxes.size_m)
    assert len(fit_near_sides(found[:0], np.zeros(0, bool), *points)) == 0
