import numpy as np
import pytest

from perception.geometry.height_grid import HeightGrid, HeightSamples, HeightSurface

GRID = HeightGrid(x0_m=-2.0, y0_m=-1.0, cell_m=0.5, nodes_x=6, nodes_y=5)


def scattered(count: int) -> np.ndarray:
    random = np.random.default_rng(0)
    return np.column_stack([random.uniform(-2, 0.5, count), random.uniform(-1, 1, count)])


def test_nodes_are_numbered_along_y_first() -> None:
    np.testing.assert_allclose(GRID.nodes_xy_m[[0, 1, 5]], [[-2, -1], [-2, -0.5], [-1.5, -1]])


def test_covering_reaches_the_high_corner() -> None:
    grid = HeightGrid.covering((-8.0, -13.0), (28.0, 13.0), 2.0)
    assert (grid.nodes_x, grid.nodes_y) == (19, 14)
    np.testing.assert_allclose(grid.nodes_xy_m[-1], [28.0, 13.0])


def test_interpolation_is_bilinear_by_hand() -> None:
    heights_m = np.zeros(GRID.size)
    heights_m[[0, 1, 5, 6]] = [1.0, 2.0, 3.0, 8.0]
    middle = GRID.bilinear(np.array([[-1.75, -0.75], [-2.0, -0.75], [-1.875, -1.0]]))
    np.testing.assert_allclose(middle.interpolate(heights_m), [3.5, 1.5, 1.5])


@pytest.mark.parametrize("stiffness", [0.01, 1.0, 100.0])
def test_fit_equals_the_dense_least_squares(stiffness: float) -> None:
    """The naive twin: all residuals stacked and solved densely."""
    random = np.random.default_rng(1)
    xy = scattered(40)
    samples = HeightSamples(
        np.column_stack([xy, random.normal(size=40)]), random.uniform(0.1, 1, 40)
    )
    prior_m = random.normal(size=GRID.size)
    rows, right = [], []

    def add(weight: float, entries: dict[int, float], value: float) -> None:
        row = np.zeros(GRID.size)
        for node, share in entries.items():
            row[node] += share
        rows.append(np.sqrt(weight) * row)
        right.append(np.sqrt(weight) * value)

    for (x, y, z), weight in zip(samples.points, samples.weights, strict=True):
        u, v = (x + 2) / 0.5, (y + 1) / 0.5
        i, j = int(u), int(v)
        u, v, n = u - i, v - j, 5 * i + j
        shares = {n: (1 - u) * (1 - v), n + 1: (1 - u) * v, n + 5: u * (1 - v), n + 6: u * v}
        add(weight, shares, z)
    for i in range(6):
        for j in range(5):
            n = 5 * i + j
            if i < 4:
                add(stiffness, {n: 1, n + 5: -2, n + 10: 1}, 0)
            if j < 3:
                add(stiffness, {n: 1, n + 1: -2, n + 2: 1}, 0)
            if i < 5 and j < 4:
                add(2 * stiffness, {n: 1, n + 1: -1, n + 5: -1, n + 6: 1}, 0)
            add(1e-3, {n: 1}, prior_m[n])
    expected = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
    found = GRID.fit(samples, stiffness, prior_m)
    np.testing.assert_allclose(found, expected, atol=1e-8)


def test_a_plane_is_fitted_exactly_however_stiff() -> None:
    xy = scattered(30)
    points = np.column_stack([xy, 0.3 * xy[:, 0] - 0.2 * xy[:, 1] + 1.0])
    samples = HeightSamples(points, np.ones(30))
    truth = 0.3 * GRID.nodes_xy_m[:, 0] - 0.2 * GRID.nodes_xy_m[:, 1] + 1.0
    found = GRID.fit(samples, 1e3, truth)
    np.testing.assert_allclose(found, truth, atol=1e-9)


def test_without_samples_the_prior_stands() -> None:
    prior_m = np.full(GRID.size, -1.7)
    nothing = HeightSamples(np.zeros((0, 3)), np.zeros(0))
    found = GRID.fit(nothing, 1.0, prior_m)
    np.testing.assert_allclose(found, prior_m, atol=1e-9)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_distance_is_along_the_normal(dtype: type) -> None:
    surface = HeightSurface(GRID, 0.75 * GRID.nodes_xy_m[:, 0])
    points = np.array([[-1.0, 0.3, 1.75], [0.2, -0.9, 0.15], [-9.0, 0.0, -6.75]], dtype)
    np.testing.assert_allclose(surface.distance_m(points), [2.0, 0.0, 0.0], atol=1e-5)
    assert surface.distance_m(points).dtype == dtype


def test_height_and_distance_agree() -> None:
    heights_m = np.random.default_rng(2).normal(0, 0.05, GRID.size)
    surface = HeightSurface(GRID, heights_m)
    xy = scattered(200)
    points = np.column_stack([xy, surface.height_m(xy)])
    np.testing.assert_allclose(surface.distance_m(points), 0, atol=1e-12)
