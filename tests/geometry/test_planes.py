from collections.abc import Callable

import numpy as np
import pytest

from perception.geometry.planes import (
    cauchy_weights,
    fit_height_plane,
    geman_mcclure_weights,
    lowest_in_cells,
    planes_through,
)
from perception.types import Float64


def test_planes_through_triples_point_up_and_lines_give_none() -> None:
    flat = [[0, 0, 1], [0, 1, 1], [1, 0, 1]]
    line = [[0, 0, 0], [1, 1, 1], [2, 2, 2]]
    planes = planes_through(np.array([flat, line], float))
    np.testing.assert_allclose(planes[0], [0, 0, 1, -1])
    assert np.isnan(planes[1]).all()


@pytest.mark.parametrize("weights_of", [cauchy_weights, geman_mcclure_weights])
def test_a_third_of_points_above_the_plane_moves_it_by_less_than_a_centimetre(
    weights_of: Callable[[Float64], Float64],
) -> None:
    random = np.random.default_rng(3)
    xy = random.uniform(-20, 20, (3000, 2))
    z = xy @ [0.02, -0.01] - 1.7
    z[::3] += random.uniform(0.5, 2, 1000)
    start = np.array([0.0, 0.0, -1.7])
    plane = fit_height_plane(xy, z, start, scale_m=0.05, rounds=30, weights_of=weights_of)
    np.testing.assert_allclose(plane[:2], [0.02, -0.01], atol=1e-4)
    assert plane[2] == pytest.approx(-1.7, abs=0.01)


def test_one_round_without_outliers_is_least_squares() -> None:
    xy = np.array([[0, 0], [2, 0], [0, 2], [2, 2], [1, 1]], float)
    z = np.array([0, 2, 0, 2, 1.5])
    plane = fit_height_plane(xy, z, np.zeros(3), scale_m=1e6, rounds=1)
    np.testing.assert_allclose(plane, [1.0, 0.0, 0.1], atol=1e-8)


def test_the_lowest_point_of_each_cell_is_kept() -> None:
    xy = np.array([[0.1, 0.1], [0.9, 0.9], [-0.1, 0.1], [1.0, 0.5]])
    z = np.array([1.0, 0.5, 2.0, 3.0])
    assert set(lowest_in_cells(xy, z, 1.0)) == {1, 2, 3}
