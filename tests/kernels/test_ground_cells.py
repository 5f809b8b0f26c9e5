"""Cells with points, beside their reference in NumPy."""

import cv2
import numpy as np

from perception.kernels.ground_cells import are_beside_cells, extents_of_parts, gather_cells

CELL_M = 0.2


def cell_numbers(along_m: np.ndarray) -> np.ndarray:
    return np.floor(along_m * (1 / CELL_M)).astype(np.int64)


def scattered(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 2, (count, 3)).astype(np.float32)


def test_cells_equal_the_reference():
    points = scattered(600, 0)
    occupancy, first, rows, places_m, counts = gather_cells(points, CELL_M)
    x, y = cell_numbers(points[:, 0]), cell_numbers(points[:, 1])
    np.testing.assert_array_equal(first, [x.min() - 1, y.min() - 1])
    cell_of = (x - first[0]) * occupancy.shape[1] + y - first[1]
    totals = np.bincount(cell_of, minlength=occupancy.size)
    np.testing.assert_array_equal(occupancy.ravel(), totals > 0)
    np.testing.assert_array_equal(rows, np.flatnonzero(totals))
    np.testing.assert_array_equal(counts, totals[rows])
    for axis in range(2):
        sums = np.bincount(cell_of, points[:, axis])
        np.testing.assert_allclose(places_m[:, axis], sums[rows] / counts, rtol=1e-12)
    highest_m = np.full(occupancy.size, -np.inf)
    np.maximum.at(highest_m, cell_of, points[:, 2])
    np.testing.assert_array_equal(places_m[:, 2], highest_m[rows])


def test_points_beside_cells_equal_the_reference():
    occupancy, first, *_ = gather_cells(scattered(30, 1), CELL_M)
    points = scattered(800, 2)
    x, y = cell_numbers(points[:, 0]) - first[0], cell_numbers(points[:, 1]) - first[1]
    is_on = (x >= 0) & (y >= 0) & (x < occupancy.shape[0]) & (y < occupancy.shape[1])
    grown = cv2.dilate(occupancy, np.ones((3, 3), np.uint8))
    expected = is_on & (grown[np.where(is_on, x, 0), np.where(is_on, y, 0)] > 0)
    found = are_beside_cells(points, occupancy, first, CELL_M)
    # Beyond the outermost row, which is empty, dilation has nothing to spread.
    np.testing.assert_array_equal(found, expected)
    assert 20 < found.sum() < 700


def test_extents_of_parts():
    labels = np.array(
        [[0, 0, 0, 0, 0], [0, 1, 0, 2, 0], [0, 1, 1, 0, 2], [0, 0, 0, 0, 2]], np.int32
    )
    rows = np.flatnonzero(labels)
    parts, sides, points = extents_of_parts(labels, rows, np.arange(1, 7))
    assert parts.tolist() == [1, 2, 1, 1, 2, 2]
    assert sides.tolist() == [0, 2, 3]
    assert points.tolist() == [0, 1 + 3 + 4, 2 + 5 + 6]
