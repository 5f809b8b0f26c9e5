"""Uncertainty of boxes: a hidden end is as uncertain as the class, sides by points and distance, fronts by traffic."""

import numpy as np
import pytest

from perception.tracking.vehicles.box_uncertainty import (
    box_deviations,
    located_covariances,
    tracked_covariances,
)
from perception.tracking.vehicles.class_sizes import CLASS_SIZES, SizePriors
from perception.types import Boxes3D

CAR = CLASS_SIZES["car"]
NONE, ALL = np.zeros(2, bool), np.ones(2)


def boxes(*yaw_rad, away_m=10.0):
    count = len(yaw_rad)
    return Boxes3D(
        np.tile([away_m, 0, -1.7], (count, 1)),
        np.tile([4.0, 1.6, 1.5], (count, 1)),
        np.array(yaw_rad),
    )


def test_half_the_error_of_a_size_is_that_of_the_centre_along_the_box():
    sizes = SizePriors.of(np.array(["Car", "Car"]))
    outlines = boxes(0.0, np.pi / 2)
    found = located_covariances(outlines, np.array([100, 100]), sizes)
    stated = box_deviations(outlines, np.array([100, 100]), sizes)
    ends, sides_m2 = stated.size_m[0, :2] / 2, 0.06**2 + 0.05**2 + 0.16**2
    np.testing.assert_allclose(found[0, :2, :2], np.diag(ends**2 + sides_m2), atol=1e-12)
    np.testing.assert_allclose(found[1, :2, :2], np.diag(ends[::-1] ** 2 + sides_m2), atol=1e-12)
    assert np.isnan(found[:, 2:, 2:]).all()


def test_few_points_far_away_locate_a_side_worse():
    sizes = SizePriors.of(np.array(["Car", "Car"]))
    near = located_covariances(boxes(0.0, 0.0), np.array([400, 4]), sizes)
    far = located_covariances(boxes(0.0, 0.0, away_m=50), np.array([400, 4]), sizes)
    of_class_m2 = sizes.deviations_m(boxes(0.0, 0.0).size_m, ALL, 4 * ALL)[0, 1] ** 2
    found = np.array([near[0, 1, 1], near[1, 1, 1], far[0, 1, 1]])
    ends = (of_class_m2 + np.array([0.02, 0.02, 0.1]) ** 2) / 4
    sides = np.array([0.06**2 + 0.05**2] * 2 + [0.06**2 + 0.25**2])
    np.testing.assert_allclose(found, ends + sides + np.array([0.08, 0.8, 0.08]) ** 2, rtol=1e-3)


def test_a_hidden_end_stays_uncertain_however_long_it_is_tracked():
    sizes = SizePriors.of(np.array(["Car"]))
    sure = np.array([True])
    found = tracked_covariances(np.zeros((1, 4, 4)), boxes(0.0), sizes, sure)
    stated = box_deviations(boxes(0.0), np.array([100]), sizes, sure)
    np.testing.assert_allclose(found[0, 0, 0], (stated.size_m[0, 0] / 2) ** 2)
    assert stated.size_m[0, 0] > 0.7 * CAR.length.deviation_m
    filtered = tracked_covariances(np.eye(4)[None], boxes(0.0), sizes, sure) - found
    np.testing.assert_allclose(filtered[0], np.diag([0.25, 0.25, 0.5, 0.5]), atol=1e-12)


def test_a_single_scan_may_be_of_another_class():
    sizes = SizePriors.of(np.array(["Car", "Car"]))
    shown, counts = boxes(0.0, 0.0), np.array([100, 100])
    once = box_deviations(shown, counts, sizes).size_m
    often = box_deviations(shown, counts, sizes, ~NONE).size_m
    assert (once > often).all()


def test_no_height_is_less_certain_than_that_of_the_class():
    sizes, counts = SizePriors.of(np.array(["Van"])), np.array([100])
    found_m = [
        box_deviations(boxes(0.0, away_m=away_m), counts, sizes).size_m[0, 2]
        for away_m in (10, 50, 200)
    ]
    assert found_m[0] < 0.2
    np.testing.assert_allclose(found_m[1:], found_m[2])


def test_few_points_tell_no_axis_of_a_single_scan_and_some_of_a_track():
    sizes, counts = SizePriors.of(np.array(["Car", "Car"])), np.array([2, 100])
    once = box_deviations(boxes(0.0, 0.0), counts, sizes).yaw_rad
    tracked = box_deviations(boxes(0.0, 0.0), counts, sizes, ~NONE).yaw_rad
    np.testing.assert_allclose(once, [np.pi / np.sqrt(12), np.hypot(0.03, 0.14)])
    np.testing.assert_allclose(tracked, np.hypot(0.03, 0.3 / np.sqrt(counts)))


def test_people_are_located_by_few_points():
    sizes, counts = SizePriors.of(np.array(["Pedestrian", "Pedestrian"])), np.array([1, 100])
    few, many = located_covariances(boxes(0.0, 0.0), counts, sizes)[:, 0, 0]
    assert few - many == pytest.approx(0.15**2 * 0.99)


def test_traffic_tells_the_front_and_an_outline_the_axis_of_what_has_sides():
    sizes = SizePriors.of(np.array(["Car", "Car", "Pedestrian"]))
    found = box_deviations(
        boxes(0.0, 0.0, 0.0),
        np.array([100, 100, 100]),
        sizes,
    )
    assert found.reversal.tolist() == [0.1, 0.1, 0.4]
    assert found.yaw_rad[0] == pytest.approx(np.hypot(0.03, 0.14))
    # Of an axis of any direction.
    assert found.yaw_rad[2] == pytest.approx(np.pi / np.sqrt(12))
