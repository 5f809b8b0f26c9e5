"""Uncertainty of moving objects: a hidden end is as uncertain as the class that is as long, both ends seen are not."""

from dataclasses import replace

import numpy as np
import pytest

from perception.tracking.track_table import TrackTable
from perception.tracking.track_update import reported_covariances, reported_deviations
from perception.tracking.vehicles.class_sizes import SizePriors


def table(count, **values) -> TrackTable:
    one, zeros = np.ones(count), np.zeros(count)
    tracks = TrackTable(
        mean=np.zeros((count, 4)), covariance=np.zeros((count, 4, 4)), yaw_rad=zeros, low_world_m=zeros,
        ids=np.arange(count), yaw_variance=zeros, sizes_m=np.ones((count, 2)),
        recent_sizes_m=np.ones((count, 3, 2)), complete_counts=np.zeros((count, 2), np.int64), heights_m=one,
        first_seen_s=zeros, first_seen_world_m=np.zeros((count, 2)), last_seen_s=zeros, last_moved_s=zeros,
        hits=np.full(count, 9), observed_s=one, points=np.full(count, 99), is_confirmed=one > 0,
    )  # fmt: skip
    return replace(tracks, **values)


def test_a_hidden_end_is_as_uncertain_as_the_class_that_is_as_long():
    sizes_m = np.array([[3.9, 1.63, 1.5], [10.0, 2.5, 3.2]])
    found = reported_deviations(table(2), sizes_m).size_m
    priors = SizePriors.of(np.array(["Car", "Truck"]))
    np.testing.assert_allclose(found, priors.deviations_m(sizes_m, np.full(2, 0.9), np.ones(2)))
    assert found[1, 0] > 5 * found[0, 0]


def test_half_of_the_error_of_a_length_is_that_of_the_centre_along_the_heading():
    sizes_m = np.tile([3.9, 1.63, 1.5], (2, 1))
    tracks = table(2, yaw_rad=np.array([0.0, np.pi / 2]))
    length_m = reported_deviations(tracks, sizes_m).size_m[0, 0]
    found = reported_covariances(tracks, sizes_m)[:, :2, :2]
    along, across = (length_m / 2) ** 2 + 0.05**2, 0.05**2
    np.testing.assert_allclose(found[0], np.diag([along, across]), atol=1e-12)
    np.testing.assert_allclose(found[1], np.diag([across, along]), atol=1e-12)


def test_a_length_is_known_once_both_ends_have_been_seen():
    tracks = table(2, complete_counts=np.array([[5, 0], [4, 0]]))
    found = reported_deviations(tracks, np.tile([6.0, 2.0, 2.0], (2, 1))).size_m[:, 0]
    assert found[0] == 0.2 < found[1]


def test_the_axis_is_known_as_well_as_outline_and_filter_tell():
    tracks = table(1, yaw_variance=np.array([0.05**2]))
    found = reported_deviations(tracks, np.array([[3.9, 1.6, 1.5]]))
    assert found.yaw_rad[0] == pytest.approx(np.hypot(0.02, 0.03))
    assert found.reversal.tolist() == [0.01]
