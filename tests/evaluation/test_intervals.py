"""Intervals of normal errors hold what they say; unknown covariances do not count."""

import numpy as np
import pytest

from perception.evaluation.intervals import interval_coverage, squared_mahalanobis


def test_distances_are_measured_in_standard_deviations():
    covariances = np.array([np.diag([4.0, 9.0]), [[2.0, 1.0], [1.0, 2.0]]])
    found = squared_mahalanobis(np.array([[2.0, 3.0], [1.0, 1.0]]), covariances)
    np.testing.assert_allclose(found, [2.0, 2 / 3])


@pytest.mark.parametrize(("ratio", "expected"), [(1.0, 0.9), (0.25, 0.44), (4.0, 0.9999)])
def test_coverage_tells_covariances_that_are_too_small_or_too_large(ratio, expected):
    random = np.random.default_rng(0)
    covariance = np.array([[2.0, 0.8], [0.8, 1.0]])
    errors = random.multivariate_normal([0, 0], covariance, 20_000)
    spread = squared_mahalanobis(errors, np.tile(ratio * covariance, (20_000, 1, 1)))
    assert abs(interval_coverage(spread, 2) - expected) < 0.01


def test_what_is_not_known_does_not_count():
    covariances = np.stack([np.eye(2), np.full((2, 2), np.nan)])
    spread = squared_mahalanobis(np.ones((2, 2)), covariances)
    np.testing.assert_array_equal(np.isnan(spread), [False, True])
    assert interval_coverage(spread, 2) == 1.0
    assert np.isnan(interval_coverage(np.array([np.nan]), 2))
