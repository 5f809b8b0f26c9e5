"""Covariance of points and the direction across their surface, beside NumPy's."""

import numpy as np
import pytest

from perception.kernels.moments import flattest_direction, write_covariance


def test_the_covariance_is_numpys():
    points = np.random.default_rng(0).normal([3.0, -2.0, 1.0], [1.0, 0.5, 0.2], (50, 3))
    x, y, z = points.T
    sums = [one.sum() for one in (x, y, z, x * x, x * y, x * z, y * y, y * z, z * z)]
    found = np.zeros((3, 3))
    write_covariance(np.array([50.0, *sums]), found)
    np.testing.assert_allclose(found, np.triu(np.cov(points.T, bias=True)), atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_direction_is_that_of_the_smallest_eigenvalue(seed):
    rng = np.random.default_rng(seed)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    covariance = axes @ np.diag([4.0, 1.0, 0.01]) @ axes.T
    found = flattest_direction(np.ascontiguousarray(covariance), 0.1, 0.05)
    assert abs(np.array(found) @ axes[:, 2]) == pytest.approx(1)


@pytest.mark.parametrize(
    ("variances", "is_surface"),
    [((4, 1, 0.01), True), ((4, 1, 0.2), False), ((4, 0.3, 0.001), False)],
    ids=["flat", "thick", "a line"],
)
def test_thick_and_narrow_points_have_none(variances, is_surface):
    found = flattest_direction(np.diag(np.array(variances, np.float64)), 0.1, 0.05)
    assert any(found) == is_surface
