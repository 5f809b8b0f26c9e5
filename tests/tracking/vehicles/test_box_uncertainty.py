"""Uncertainty of boxes: a hidden end is as uncertain as the class, sides by points and distance, fronts by motion."""

import numpy as np
import pytest

from perception.tracking.vehicles.box_uncertainty import (
    box_deviations,
    located_covariances,
    tracked_covariances,
)
from perception.tracking.vehicles.class_sizes import CLASS_SIZES, SizePriors
from perception.tracking.vehicles.config import BoxUncertaintyConfig
from perception.types import Boxes3D

EXACT_SIDES = BoxUncertaintyConfig(side_noise_m=0.0, side_noise_per_m=0.0, sparse_noise_m=0.0)
CAR, WALKER = CLASS_SIZES["car"], CLASS_SIZES["pedestrian"]


def boxes(*yaw_rad, away_m=10.0):
    count = len(yaw_rad)
    return Boxes3D(
        np.tile([away_m, 0, -1.7], (count, 1)),
        np.tile([4.0, 1.6, 1.5], (count, 1)),
        np.array(yaw_rad),
    )


def test_half_the_error_of_a_size_is_that_of_the_centre_along_the_box():
    sizes = SizePriors.of(np.array(["Car", "Car"]))
    found = located_covariances(boxes(0.0, np.pi / 2), np.array([100, 100]), sizes, EXACT_SIDES)
    ends = np.array([CAR.length.deviation_m, CAR.width.deviation_m]) / 2
    np.testing.assert_allclose(found[0, :2, :2], np.diag(ends**2), atol=1e-12)
    np.testing.assert_allclose(found[1, :2, :2], np.diag(ends[::-1] ** 2), atol=1e-12)
    assert np.isnan(found[:, 2:, 2:]).all()


def test_few_points_far_away_locate_a_side_worse():
    sizes, config = SizePriors.of(np.array(["Car", "Car"])), BoxUncertaintyConfig()
    near = located_covariances(boxes(0.0, 0.0), np.array([400, 4]), sizes, config)
    far = located_covariances(boxes(0.0, 0.0, away_m=50), np.array([400, 4]), sizes, config)
    across = np.sqrt([near[0, 1, 1], near[1, 1, 1], far[0, 1, 1]])
    end_m = CAR.width.deviation_m / 2
    expected = [np.hypot(end_m, 0.02), np.hypot(end_m, 0.2), np.hypot(end_m, 0.02)]
    sides = [np.hypot(0.06, 0.05), np.hypot(0.06, 0.05), np.hypot(0.06, 0.25)]
    np.testing.assert_allclose(across, np.hypot(expected, sides))


def test_a_hidden_end_stays_uncertain_however_long_it_is_tracked():
    sizes, config = SizePriors.of(np.array(["Car"])), BoxUncertaintyConfig()
    found = tracked_covariances(np.zeros((1, 4, 4)), np.zeros(1), sizes, config)
    np.testing.assert_allclose(found[0, 0, 0], (CAR.length.deviation_m / 2) ** 2)
    filtered = tracked_covariances(np.eye(4)[None], np.zeros(1), sizes, config) - found
    np.testing.assert_allclose(filtered[0], np.diag([0.25, 0.25, 0.5, 0.5]), atol=1e-12)


def test_motion_shows_the_front_and_an_outline_the_axis_of_what_has_sides():
    sizes = SizePriors.of(np.array(["Car", "Car", "Pedestrian"]))
    found = box_deviations(
        boxes(0.0, 0.0, 0.0),
        np.array([100, 100, 100]),
        sizes,
        np.array([False, True, False]),
        BoxUncertaintyConfig(),
    )
    assert found.reversal.tolist() == [0.1, 0.02, 0.4]
    assert found.yaw_rad[0] == pytest.approx(np.hypot(0.03, 0.03))
    # Of an axis of any direction.
    assert found.yaw_rad[2] == pytest.approx(np.pi / np.sqrt(12))
    np.testing.assert_allclose(found.size_m[2, 1], np.hypot(WALKER.width.deviation_m, 0.03))
