from dataclasses import replace

import numpy as np
import pytest

from perception.datmo.cell_grid import CellGrid
from perception.datmo.config import AUTHOR, THESIS
from perception.datmo.elevation import LevelPlane, elevation_grid
from perception.geometry.grids import LocalArea
from tests.reference.datmo import elevation_by_loop

ROAD = LevelPlane(-1.7)
CELLS = CellGrid.covering(LocalArea(ahead_m=4.0, behind_m=2.0, side_m=3.0), 0.2)


def cell_with(heights_m, config=THESIS):
    """Return the value of one cell that holds points at such heights over the road."""
    points = np.zeros((len(heights_m), 4), np.float32)
    points[:, :2] = 3.1, 0.5
    points[:, 2] = np.array(heights_m) - 1.7
    grid = elevation_grid(points, ROAD, CELLS, config)
    assert grid.points.sum() == grid.points[25, 17] == len(heights_m)
    return grid.height_m[25, 17]


def test_a_low_flat_cell_is_ground():
    assert cell_with([0.10, 0.15, 0.20]) == 0


@pytest.mark.parametrize(
    "heights_m", [[0.4, 0.5, 0.6], [0.0, 0.0, 0.5]], ids=["high and flat", "low and rough"]
)
def test_what_is_high_or_rough_is_worth_its_mean(heights_m):
    assert cell_with(heights_m) == pytest.approx(np.mean(heights_m), abs=1e-6)


def test_the_variance_is_that_of_a_sample():
    # 0.010 by n, 0.020 by n - 1: the threshold lies between.
    config = replace(THESIS, ground_variance_m2=0.015)
    assert cell_with([0.0, 0.2], config) == pytest.approx(0.1, abs=1e-6)


def test_the_thesis_compares_the_mean_and_the_author_the_highest_point():
    heights_m = [0.5, 0.55, 0.6]
    assert cell_with(heights_m) > 0
    assert cell_with(heights_m, AUTHOR) == 0
    assert cell_with([0.7, 0.75, 0.85], AUTHOR) > 0


def test_observed_ground_differs_from_unobserved_cells():
    points = np.array([[3.1, 0.5, -1.7, 0]], np.float32)
    grid = elevation_grid(points, ROAD, CELLS, THESIS)
    assert grid.is_observed.sum() == 1
    assert not grid.height_m.any()


def test_points_near_the_lidar_and_out_of_reach_are_left_out():
    points = np.array(
        [[2.9, 0, 0, 0], [3.1, 0, 0, 0], [3.1, 0, 0.9, 0], [3.1, 0, -2.8, 0], [4.1, 0, 0, 0]],
        np.float32,
    )
    assert elevation_grid(points, ROAD, CELLS, THESIS).points.sum() == 1


def test_an_empty_scan_observes_no_cell():
    grid = elevation_grid(np.zeros((0, 4), np.float32), ROAD, CELLS, THESIS)
    assert not grid.is_observed.any()
    assert grid.height_m.shape == (30, 30)


@pytest.mark.parametrize("config", [THESIS, AUTHOR], ids=["thesis", "author"])
def test_the_fast_form_equals_the_loop(config):
    rng = np.random.default_rng(3)
    points = rng.uniform((-3, -4, -2.5, 0), (5, 4, 1, 1), (4000, 4)).astype(np.float32)
    points[::2, 2] = -1.7 + rng.normal(0, 0.02, 2000)
    fast = elevation_grid(points, ROAD, CELLS, config)
    reference = elevation_by_loop(points, ROAD, CELLS, config)
    np.testing.assert_array_equal(fast.points, reference.points)
    np.testing.assert_allclose(fast.height_m, reference.height_m, atol=1e-5)
    assert (fast.height_m != 0).sum() > 100


def test_heights_are_measured_over_the_ground_that_is_given():
    class Slope:
        def distance_m(self, points_velo):
            return points_velo[:, 2] + 1.7 - 0.1 * points_velo[:, 0]

    points = np.array([[3.5, 0.5, -1.7 + 0.35, 0]] * 3, np.float32)
    assert elevation_grid(points, ROAD, CELLS, THESIS).height_m.max() > 0.3
    assert elevation_grid(points, Slope(), CELLS, THESIS).height_m.max() == 0


def test_cells_and_metres():
    assert CELLS.shape == (30, 30)
    np.testing.assert_allclose(CELLS.centers_m(np.array([0, 29]), np.array([0, 29]))[1], (3.9, 2.9))
    np.testing.assert_allclose(CELLS.cells_T_velo @ (1.1, 0.5, 1), (15.5, 17.5, 1))
    rows, columns = CELLS.part(LocalArea(ahead_m=2.0, behind_m=1.0, side_m=1.0))
    assert (rows.start, rows.stop, columns.start, columns.stop) == (5, 20, 10, 20)
