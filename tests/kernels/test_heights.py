"""Compiled functions of heights, each beside its reference in NumPy."""

import numpy as np

from perception.geometry.se3 import from_euler
from perception.kernels.heights import (
    add_normal_equations,
    cells_of,
    lowest_of_cells,
    moved_samples,
    points_over_cells,
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


def test_moved_samples_are_those_over_the_grid_whose_height_the_poses_tell() -> None:
    random = np.random.default_rng(3)
    points, weights = random.normal(0, 2, (3000, 3)), random.random(3000)
    motion = from_euler(0.1, -0.2, 1.0, np.array([0.5, 0.3, -0.2]))
    world_R_dst = from_euler(0.02, 0.01, -2.0, np.zeros(3))[:3, :3].copy()
    half = random.normal(0, 0.01, (3, 3))
    covariance = half @ half.T
    found, kept = moved_samples(points, weights, motion, world_R_dst, covariance, 0.02, GRID)
    moved = points @ motion[:3, :3].T + motion[:3, 3]
    away_m = moved @ world_R_dst.T
    terms = np.column_stack([np.ones(3000), away_m[:, 1], -away_m[:, 0]])
    deviations_m = np.sqrt(((terms @ covariance) * terms).sum(axis=1))
    is_inside, is_known = cells_of(moved, GRID) >= 0, deviations_m <= 0.02
    assert 20 < (is_inside & is_known).sum() < is_inside.sum() - 20
    np.testing.assert_allclose(found, moved[is_inside & is_known], atol=1e-12)
    np.testing.assert_array_equal(kept, weights[is_inside & is_known])


def test_a_pitch_lifts_what_is_ahead_and_a_roll_what_is_beside() -> None:
    covariance = np.diag([0.03**2, 0.01**2, 0.02**2])
    places = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
    for limit_m, expected in ((0.049, 1), (0.051, 2), (0.203, 3)):
        args = (np.eye(4), np.eye(3), covariance, limit_m, (-20.0, -20.0, 1.0, 41, 41))
        assert len(moved_samples(places, np.ones(3), *args)[0]) == expected


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
