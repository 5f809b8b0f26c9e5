"""The grid of angles of a LiDAR and its edges, beside NumPy's."""

import numpy as np
import pytest

from perception.kernels.angle_grid import (
    AT_LEFT,
    AT_RIGHT,
    AT_TOP,
    edges_of_grid,
    nearest_by_angle,
)
from tests.reference.scan_edges import edges_by_shifts, ranges_by_angle

ELEVATIONS_RAD = np.radians(np.linspace(2, -24, 20))
COLUMN_RAD = np.radians(0.5)
LIMITS = 60.0, 1.1, 0.4, 0.02, 0.25


def grid_of(points, rows=None):
    sines = np.sin((ELEVATIONS_RAD[:-1] + ELEVATIONS_RAD[1:]) / 2)
    rows = np.arange(len(points)) if rows is None else rows
    return nearest_by_angle(points, rows, 1.0, 0.0, COLUMN_RAD, sines, 1.0)


@pytest.fixture(scope="module")
def points():
    """Returns of walls at 5 to 15 m, the nearer the higher, and of what is behind, in random directions."""
    rng = np.random.default_rng(4)
    azimuths, elevations = rng.uniform(-0.7, 0.7, 20_000), rng.uniform(-0.45, 0.06, 20_000)
    walls_m = 5 + 5 * (np.floor(8 * azimuths) % 3)
    is_behind = (rng.uniform(size=20_000) < 0.2) | (elevations > 0.02 - walls_m / 100)
    reach = np.where(is_behind, 40.0, walls_m)
    directions = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.tan(elevations)])
    found = np.column_stack([reach[:, None] * directions, np.zeros(20_000)]).astype(np.float32)
    # Directions are good to 1e-5 rad: none is so near to the border of a column.
    columns = np.arctan2(found[:, 1], found[:, 0]) / COLUMN_RAD
    return found[np.abs(columns - np.rint(columns)) > 5e-3]


def test_the_nearest_return_of_each_direction_is_numpys(points):
    ranges_m, point_of = grid_of(points)
    assert np.isinf(ranges_m[[0, -1]]).all()
    assert np.isinf(ranges_m[:, [0, 1, -2, -1]]).all()
    expected_m = ranges_by_angle(points, ELEVATIONS_RAD, COLUMN_RAD)
    np.testing.assert_array_equal(ranges_m[1:-1, 2:-2], expected_m)
    has_return = np.isfinite(expected_m)
    assert 0.9 < has_return.mean() < 1
    np.testing.assert_array_equal(point_of >= 0, has_return)
    found_m = np.linalg.norm(points[point_of[has_return], :3].astype(np.float64), axis=1)
    np.testing.assert_allclose(found_m, expected_m[has_return], rtol=1e-6)


def test_edges_are_those_of_shifted_grids(points):
    ranges_m, _ = grid_of(points)
    edges = edges_of_grid(ranges_m, *LIMITS)
    rows, columns, sides = edges_by_shifts(ranges_m[1:-1, 2:-2])
    expected = np.zeros_like(edges)
    for side, kind in ((-1, AT_LEFT), (1, AT_RIGHT), (0, AT_TOP)):
        at = rows[sides == side], columns[sides == side]
        assert len(at[0]) > 10
        expected[at] += np.uint8(kind)
    np.testing.assert_array_equal(edges, expected)


def test_returns_of_other_rows_near_ones_and_broken_ones_are_left_out():
    points = np.array(
        [[10, 0, 0, 0], [5, 0, 0, 0], [0.5, 0, 0, 0], [np.nan, 0, 0, 0], [np.inf, 0, 0, 0]],
        np.float32,
    )
    ranges_m, point_of = grid_of(points, np.array([0, 2, 3, 4]))
    assert ranges_m[np.isfinite(ranges_m)].tolist() == [10.0]
    assert point_of.max() == 0
    ranges_m, point_of = grid_of(points, np.array([2, 3]))
    assert ranges_m.shape == (22, 4)
    assert point_of.shape == (20, 0)
    assert edges_of_grid(ranges_m, *LIMITS).shape == (20, 0)
