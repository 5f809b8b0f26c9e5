"""Compiled functions of range images, beside references in NumPy."""

import numpy as np
import pytest

from perception.kernels.range_images import nearest_returns, pixels_of, visibility_of

COLUMNS, ROWS = 90, 6
NEAREST = np.repeat(np.arange(ROWS, dtype=np.int32)[::-1], 4)
# The lower half of the directions of a row has the next one on its other side, where there is one.
NEXT = np.clip(NEAREST + np.tile(np.array([1, 1, -1, -1], np.int32), ROWS), 0, ROWS - 1)
SLOPES = np.stack([NEAREST, NEXT])
ELEVATIONS_RAD = np.radians([12, 6, 3, 0, -6, -15]).astype(np.float32)
BLOCKS = np.array([[1, 1], [1, 2], [2, 4], [3, 8]])
PROJECTION = (-0.6, 20.0, COLUMNS / (2 * np.pi), COLUMNS)


def scattered(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, (8, 8, 2), (count, 3)).astype(np.float32)


def reference_pixels(points: np.ndarray) -> tuple[np.ndarray, ...]:
    x, y, z = points.T.astype(np.float64)
    across = np.hypot(x, y)
    step = (z / np.maximum(across, 1e-3) + 0.6) * 20.0
    rows, next_rows = SLOPES[:, np.clip(step, 0, len(NEAREST) - 1).astype(int)]
    columns = np.minimum((np.arctan2(y, x) % (2 * np.pi)) * PROJECTION[2], COLUMNS - 1).astype(int)
    is_in_view = (step >= 0) & (step <= len(NEAREST) - 1)
    return rows, next_rows, columns, np.hypot(across, z), is_in_view


def test_pixels_equal_the_reference() -> None:
    points = scattered(5000)
    rows, next_rows, columns, ranges_m, is_in_view = pixels_of(points, SLOPES, PROJECTION)
    expected = reference_pixels(points)
    # In single precision a point at the border of two pixels may fall into either.
    assert (rows != expected[0]).mean() < 1e-3
    assert (next_rows != expected[1]).mean() < 1e-3
    assert (columns != expected[2]).mean() < 1e-3
    np.testing.assert_allclose(ranges_m, expected[3], rtol=1e-6)
    assert (is_in_view != expected[4]).mean() < 1e-3


@pytest.mark.parametrize("angle_rad", np.linspace(0.01, 6.27, 40))
def test_columns_go_once_around(angle_rad: float) -> None:
    point = 9 * np.array([[np.cos(angle_rad), np.sin(angle_rad), 0]], np.float32)
    _, _, columns, _, _ = pixels_of(point, SLOPES, (-0.6, 20.0, 1e3, 10_000))
    assert abs(columns[0] - 1e3 * angle_rad) < 1.1


def test_a_point_at_the_origin_has_a_pixel() -> None:
    rows, _, columns, ranges_m, _ = pixels_of(np.zeros((1, 3), np.float32), SLOPES, PROJECTION)
    assert (columns[0], ranges_m[0]) == (0, 0)
    assert 0 <= rows[0] < ROWS


def test_the_nearest_return_of_each_pixel_is_kept() -> None:
    points = scattered(3000)
    rows, _, columns, ranges_m, is_in_view = pixels_of(points, SLOPES, PROJECTION)
    expected = np.full((ROWS, COLUMNS), np.inf, np.float32)
    np.minimum.at(expected, (rows[is_in_view], columns[is_in_view]), ranges_m[is_in_view])
    np.testing.assert_array_equal(nearest_returns(points, SLOPES, PROJECTION, ROWS), expected)


def framed(image: np.ndarray) -> np.ndarray:
    return np.pad(np.pad(image, ((0, 0), (1, 1)), "wrap"), ((1, 1), (0, 0)), "edge")


def test_hits_equal_the_reference() -> None:
    beams_m = framed(nearest_returns(scattered(2000), SLOPES, PROJECTION, ROWS))
    places = scattered(500, seed=2)
    rows, _, columns, ranges_m, is_in_view = pixels_of(places, SLOPES, PROJECTION)
    around = [(i, j) for i in range(3) for j in range(3)]
    beyond_m = np.stack([beams_m[rows + i, columns + j] - ranges_m for i, j in around])
    is_near = np.abs(beyond_m) < np.float32(0.3)
    states, gaps_m = visibility_of(
        places, SLOPES, PROJECTION, BLOCKS, beams_m, ELEVATIONS_RAD, 30.0, 0.3
    )
    is_hit = is_near.any(axis=0) & is_in_view
    np.testing.assert_array_equal(states == 2, is_hit)
    is_occluded = (beyond_m[4] < -np.float32(0.3)) & is_in_view & ~is_hit
    np.testing.assert_array_equal(states == 3, is_occluded)
    np.testing.assert_allclose(gaps_m, np.where(is_occluded, -beyond_m[4], 0))


def test_free_places_equal_the_reference() -> None:
    """All returns of the block go farther, and a beam on either side of the place has one."""
    scan = scattered(500, seed=3) * 2
    beams_m = nearest_returns(scan, SLOPES, PROJECTION, ROWS)
    places = scattered(500, seed=4)
    rows, next_rows, columns, ranges_m, is_in_view = pixels_of(places, SLOPES, PROJECTION)
    args = (framed(beams_m), ELEVATIONS_RAD, 6.0, 0.3)
    free = visibility_of(places, SLOPES, PROJECTION, BLOCKS, *args)[0] == 1
    for place in np.flatnonzero(is_in_view):
        row, following, range_m = rows[place], next_rows[place], ranges_m[place]
        above, reach = BLOCKS[int(np.sum(range_m * np.array([1, 2, 4], np.float32) < 6.0))]
        near = np.arange(columns[place] - reach, columns[place] + reach + 1) % COLUMNS
        returned = np.flatnonzero(np.isfinite(beams_m[:, near]).any(axis=1))
        side = following - row or 1
        is_bounded = [
            any(
                (other - first) * step >= 0
                and abs(ELEVATIONS_RAD[other] - ELEVATIONS_RAD[first])
                <= reach * 2 * np.pi / COLUMNS
                for other in returned
            )
            for first, step in ((row, -side), (following, side))
        ]
        block_m = beams_m[max(row - above, 0) : row + above + 1, near]
        is_passed = np.isfinite(block_m.min()) and block_m.min() > range_m + np.float32(0.3)
        assert free[place] == (is_passed and all(is_bounded))
    assert 0.1 < free[is_in_view].mean() < 0.9
    assert not free[~is_in_view].any()
