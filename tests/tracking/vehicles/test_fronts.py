"""The front of a vehicle: by its shape, and by how those around it head."""

from dataclasses import replace

import numpy as np
import pytest

from perception.tracking.vehicles.fronts import FrontRecord, shape_odds, with_fronts
from perception.types import BoxDeviations, Boxes3D, Detections, FusedDetections, Vehicles


def hatchback(yaw_rad):
    """Return a car at 10 m whose stated heading is given, of which the true one is 0, and returns of its left side."""
    along, high = (
        one.ravel() for one in np.meshgrid(np.linspace(-1.9, 1.9, 39), [0.4, 0.8, 1.2, 1.4])
    )
    is_body = (high < 0.9) | (along < 0.4)  # a hood before the cabin
    points = np.column_stack([along, np.full(len(along), 0.8), high, np.zeros(len(along))])
    boxes = Boxes3D(np.array([[0.0, 10, 0]]), np.array([[3.9, 1.6, 1.5]]), np.array([yaw_rad]))
    points = points[is_body] + [0.0, 10, 0, 0]
    shown = Detections(np.array([[0.0, 0, 9, 9]]), np.array([0.9]), np.array(["Car"]))
    car = Vehicles(
        fused=FusedDetections.unfused(shown),
        ids=np.array([-1]),
        boxes=boxes,
        distances_m=np.array([9.0]),
        velocities_m_s=np.zeros((1, 2)),
        covariances=np.zeros((1, 4, 4)),
        box_deviations=BoxDeviations(np.ones((1, 3)), np.zeros(1), np.array([0.05])),
        owners=np.zeros(len(points), np.int64),
    )
    return car, points


@pytest.mark.parametrize("yaw_rad", [0.0, np.pi])
def test_the_lower_end_before_the_cabin_is_the_front(yaw_rad):
    vehicles, points = hatchback(yaw_rad)
    odds = shape_odds(vehicles, points)
    assert np.sign(odds[0]) == np.sign(np.cos(yaw_rad))
    assert 2.0 < abs(odds[0]) < 3.0
    turned = with_fronts(vehicles, odds)
    assert np.cos(turned.boxes.yaw_rad[0]) == pytest.approx(1.0)
    assert 0.05 < turned.box_deviations.reversal[0] < 0.12


def test_few_returns_and_other_classes_tell_no_front():
    vehicles, points = hatchback(0.0)
    few = replace(vehicles, owners=np.where(np.arange(len(points)) < 2, 0, -1))
    assert shape_odds(few, points).tolist() == [0.0]
    trucks = vehicles.with_detections(types=np.array(["Truck"]))
    assert shape_odds(trucks, points).tolist() == [0.0]


def test_vehicles_that_head_otherwise_turn_what_is_expected():
    record, known = FrontRecord(), hatchback(0.0)[0]
    assert record.reliability == pytest.approx(0.9, abs=0.02)
    before = record.odds(known, np.zeros(1))
    for _ in range(5):
        record.update(np.full(6, -3.0), np.full(6, True), 0.5)
    assert record.reliability < 0.25
    assert record.odds(known, np.zeros(1))[0] < -1.0 < 1.5 < before[0]
    # What tells nothing, and another look at the same, changes nothing and little.
    reliability = record.reliability
    record.update(np.zeros(50), np.full(50, True), 0.0)
    record.update(np.full(6, 3.0), np.full(6, False), 0.1)
    assert record.reliability == pytest.approx(reliability, abs=0.05)
