"""Compiled functions of heights, each beside its reference in NumPy."""

import numpy as np

from perception.kernels.heights import (
    add_normal_equations,
    cells_of,
    lowest_of_cells,
    points_over_cells,
    robust_plane,
    sums_of_cells,
)

GRID = (-2.0, -1.0, 0.5, 6, 5)
SIZE = 30


def scattered(count: int = 400) -> np.ndarray:
    random = np.random.default_rng(0)
    low, high = (-3, -2, -0.4, 0), (1.5, 2, 0.6, 1)
    # Rounded, so that several points of a cell are equally low.
    return np.round(random.uniform(low, high, (count, 4)), 1).astype(np.float32)


def test_points_over_cells_equal_the_reference() -> None:
    points = scattered()
    found, cells = points_over_cells(points, 3, GRID)
    thinned = points[::3]
    i, j = np.floor((thinned[:, 0] + 2) / 0.5), np.floor((thinned[:, 1] + 1) / 0.5)
    inside = (i >= 0) & (i < 5) & (j >= 0) & (j < 4)
    np.testing.assert_array_equal(found, thinned[inside, :3])
    np.testing.assert_array_equal(cells, (5 * i + j)[inside])


def test_cells_equal_the_reference() -> None:
    points = scattered()[:, :3].astype(np.float64)
    i, j = np.floor((points[:, 0] + 2) / 0.5), np.floor((points[:, 1] + 1) / 0.5)
    inside = (i >= 0) & (i < 5) & (j >= 0) & (j < 4)
    np.testing.assert_array_equal(cells_of(points, GRID), np.where(inside, 5 * i + j, -1))


def test_points_may_be_read_only() -> None:
    points = scattered()
    points.flags.writeable = False
    assert len(points_over_cells(points, 1, GRID)[0]) > 100


def test_lowest_points_equal_the_reference_and_keep_ties() -> None:
    points, cells = points_over_cells(scattered(), 1, GRID)
    found = lowest_of_cells(points, cells, SIZE, -0.1, 0.2, 0.05)
    x, y, z = points.T.astype(np.float64)
    usable = np.abs(z + 0.1) < 0.2 + 0.05 * np.hypot(x, y)
    lowest_m = np.full(SIZE, np.inf)
    np.minimum.at(lowest_m, cells[usable], z[usable])
    expected = points[usable & (z == lowest_m[cells])]
    np.testing.assert_array_equal(found, expected)
    assert len(found) > len(np.unique(cells[usable]))


def test_sums_equal_the_reference() -> None:
    points, cells = points_over_cells(scattered(), 1, GRID)
    ground_m = np.linspace(-0.1, 0.1, SIZE)
    sums, has_obstacle = sums_of_cells(points, cells, ground_m, 0.2, 0.3, 0.5)
    above_m = points[:, 2] - ground_m[cells]
    near, high = np.abs(above_m) < 0.2, (above_m > 0.3) & (above_m < 0.5)
    values = np.column_stack([points, np.ones(len(points))])[near]
    expected = [np.bincount(cells[near], column, SIZE) for column in values.T]
    np.testing.assert_allclose(sums, np.transpose(expected))
    np.testing.assert_array_equal(has_obstacle, np.bincount(cells[high], minlength=SIZE) > 0)


def test_a_robust_plane_leaves_out_what_stands_on_it() -> None:
    random = np.random.default_rng(1)
    xy = random.uniform(-20, 20, (600, 2))
    z = 0.02 * xy[:, 0] - 0.01 * xy[:, 1] - 1.6
    z[::4] += 1.0
    found = robust_plane(np.column_stack([xy, z]), -1.73, 12)
    np.testing.assert_allclose(found, [0.02, -0.01, -1.6], atol=2e-3)


def test_normal_equations_equal_the_reference() -> None:
    random = np.random.default_rng(2)
    points = scattered()[:, :3].astype(np.float64, order="C")
    weights, heights_m = random.uniform(0.1, 1, len(points)), random.normal(0, 0.1, SIZE)
    banded = np.zeros((SIZE, 11))
    right = add_normal_equations(points, weights, heights_m, (0.4, 0.2), GRID, banded)

    u, v = (points[:, 0] + 2) / 0.5, (points[:, 1] + 1) / 0.5
    i, j = np.clip(np.floor(u), 0, 4).astype(int), np.clip(np.floor(v), 0, 3).astype(int)
    u, v = u - i, v - j
    shares = np.zeros((len(points), SIZE))
    rows = np.arange(len(points))
    shares[rows, 5 * i + j], shares[rows, 5 * i + j + 1] = (1 - u) * (1 - v), (1 - u) * v
    shares[rows, 5 * i + j + 5], shares[rows, 5 * i + j + 6] = u * (1 - v), u * v
    misfit_m = points[:, 2] - shares @ heights_m
    robust = weights / (1 + (misfit_m / np.where(misfit_m < 0, 0.4, 0.2)) ** 2) ** 2
    matrix = shares.T @ (robust[:, None] * shares)
    np.testing.assert_allclose(right, shares.T @ (robust * points[:, 2]))
    for node in range(SIZE):
        for before in range(max(0, node - 10), node + 1):
            np.testing.assert_allclose(banded[node, 10 - (node - before)], matrix[before, node])
