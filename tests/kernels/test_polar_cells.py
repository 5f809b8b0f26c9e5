"""Cells around a sensor, compared with the same by NumPy."""

import numpy as np

from perception.kernels.polar_cells import cells_of_points, passed_cells

GRID, COUNT, SECTORS = (-10.03, -9.9, 0.2), 101, 72


def test_points_are_in_the_cells_of_their_positions():
    generator = np.random.default_rng(0)
    points = generator.uniform(-15, 15, (5000, 4)).astype(np.float32)
    angle = 0.3
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0.05], [np.sin(angle), np.cos(angle), 0]])
    cells, xy_m = cells_of_points(points, rotation, GRID, COUNT)
    expected_m = points[:, :3].astype(np.float64) @ rotation.T
    assert np.allclose(xy_m, expected_m, atol=1e-12)
    column, row = np.floor((xy_m - GRID[:2]) / GRID[2]).astype(int).T
    is_inside = (np.minimum(column, row) >= 0) & (np.maximum(column, row) < COUNT)
    assert (cells == np.where(is_inside, row * COUNT + column, COUNT**2)).all()
    assert 0 < is_inside.sum() < len(points)


def sectors_of(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return sectors that are even steps along the sides of a diamond around the sensor."""
    share = y / (np.abs(x) + np.abs(y))
    turned = np.where(x < 0, np.where(y < 0, -2, 2) - share, share)
    return np.minimum(((turned + 2) * (SECTORS / 4)).astype(int), SECTORS - 1)


def test_a_beam_passes_low_over_the_last_part_of_its_way():
    generator = np.random.default_rng(1)
    angles, ranges_m = generator.uniform(-np.pi, np.pi, 400), generator.uniform(2, 20, 400)
    xy_m = np.stack([ranges_m * np.cos(angles), ranges_m * np.sin(angles)], 1)
    is_ground = np.arange(400) < 300
    is_obstacle = (np.arange(400) >= 300) & (np.arange(400) < 340)
    found = passed_cells(xy_m, is_ground, is_obstacle, 0.8, GRID, COUNT, SECTORS)
    sectors = sectors_of(*xy_m.T)
    expected = np.zeros((COUNT, COUNT), bool)
    for row, column in np.ndindex(expected.shape):
        x, y = GRID[0] + 0.2 * (column + 0.5), GRID[1] + 0.2 * (row + 0.5)
        step = int(np.hypot(x, y) / 0.2)
        own = sectors == sectors_of(x, y)
        limit_m = ranges_m[own & is_obstacle].min(initial=np.inf)
        beams_m = ranges_m[own & is_ground & (ranges_m < limit_m)]
        low = (beams_m * 0.8 / 0.2).astype(int) <= step
        expected[row, column] = (low & (step <= (beams_m / 0.2).astype(int))).any() and step < 76
    assert (found == expected).all()
    assert 0 < found.sum() < found.size
