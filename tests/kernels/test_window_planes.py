"""Planes through the returns around pixels, beside NumPy's."""

import numpy as np
import pytest

from perception.kernels.window_planes import moments_of_view, planes_at_pixels

CELL_PX = 4.0
IMAGE_P_VELO = np.array(
    [[100.0, 0, 0, 50], [0, 100, 0, 40], [0, 0, 0, 1]]
)  # x and y of a table seen from above
WINDOWS = np.array([(1, 1), (3, 3)])


def planes(points, pixels, min_returns=6, most=9):
    moments = moments_of_view(
        np.column_stack([points, np.zeros(len(points))]).astype(np.float32),
        IMAGE_P_VELO, CELL_PX, 25, 20, 0.5, 2.0,
    )  # fmt: skip
    places = np.array(pixels, np.float64)
    return planes_at_pixels(moments, places, CELL_PX, WINDOWS, min_returns, most)


def grid(height):
    """Return points 1 cm apart around the middle of the image, at heights by x and y."""
    x, y = (
        one.ravel() for one in np.meshgrid(np.arange(-0.25, 0.25, 0.01), np.arange(-0.2, 0.2, 0.01))
    )
    return np.column_stack([x, y, height(x, y)])


def test_moments_of_cells_are_numpys():
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.6, 0.6, (500, 3)).astype(np.float32)
    moments = moments_of_view(
        np.column_stack([points, np.zeros(500)]).astype(np.float32),
        IMAGE_P_VELO, CELL_PX, 25, 20, 0.5, 2.0,
    )  # fmt: skip
    x, y, z = points.astype(np.float64).T
    values = np.column_stack([np.ones(500), x, y, z, x * x, x * y, x * z, y * y, y * z, z * z])
    column, row = np.floor((100 * x + 50) / 4).astype(int), np.floor((100 * y + 40) / 4).astype(int)
    inside = (column >= 0) & (column < 25) & (row >= 0) & (row < 20)
    expected = np.zeros((20, 25, 10))
    np.add.at(expected, (row[inside], column[inside]), values[inside])
    assert 200 < inside.sum() < 400
    np.testing.assert_allclose(moments, expected, atol=1e-12)


def test_a_plane_is_found_where_returns_lie_on_it():
    slope = np.array([0.3, -0.2, -1.0])
    points = grid(lambda x, y: 0.3 * x - 0.2 * y + 1.5)
    found = planes(points, [(50, 40), (40, 50)])
    normal = slope / np.linalg.norm(slope)
    for plane in found:
        assert abs(abs(plane[:3] @ normal) - 1) < 1e-9
        assert plane[3] == pytest.approx(plane[:3] @ [0, 0, 1.5])


def test_no_more_planes_are_found_than_asked():
    points = grid(lambda x, y: 0.3 * x - 0.2 * y + 1.5)
    pixels = [(4, 4), (50, 40), (40, 50), (45, 45)]  # the first one has no return around
    found = planes(points, pixels, most=2)
    np.testing.assert_array_equal(np.isnan(found[:, 3]), [True, False, False, True])
    np.testing.assert_array_equal(found[1:3], planes(points, pixels)[1:3])


@pytest.mark.parametrize(
    ("height", "pixel"),
    [
        (lambda x, y: 1.5 + 0.2 * np.sin(900 * x + 700 * y), (50, 40)),  # rough
        (lambda x, y: 1.5 + 0 * x, (4, 4)),  # no return around
        (lambda x, y: np.where(x > 0, 1.5, 1.0), (50, 40)),  # a step
        (lambda x, y: 1e-3 * x, (50, 40)),  # passes through the LiDAR: a fan
    ],
    ids=["rough", "empty", "step", "fan"],
)
def test_there_is_no_plane_where_returns_do_not_lie_flat(height, pixel):
    assert np.isnan(planes(grid(height), [pixel])).all()


def test_returns_on_one_line_ask_a_wider_window():
    line = np.column_stack([np.arange(-0.4, 0.4, 0.005), np.zeros(160), np.full(160, 1.5)])
    beside = line + np.array([0, 0.08, 0.0])
    assert np.isnan(planes(line, [(50, 40)])).all()
    (plane,) = planes(np.concatenate([line, beside]), [(50, 40)])
    np.testing.assert_allclose(np.abs(plane), [0, 0, 1, 1.5], atol=1e-6)


def test_few_returns_ask_a_wider_window():
    points = np.random.default_rng(0).choice(grid(lambda x, y: 1.5 + 0 * x), 100)
    assert np.isnan(planes(points, [(50, 40)], min_returns=101)).all()
    assert np.isfinite(planes(points, [(50, 40)])).all()
