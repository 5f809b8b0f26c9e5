"""Compiled cropping, beside NumPy's masks."""

import numpy as np
import pytest

from perception.geometry.camera import project
from perception.kernels.cropping import (
    crop,
    rows_within_mask,
    rows_within_planes,
    split_by_height,
)

RECTANGLE = (-2.0, 3.0, -1.0, 1.5)


def scan(columns: int, count: int = 500) -> np.ndarray:
    points = np.random.default_rng(0).uniform(-4, 4, (count, columns)).astype(np.float32)
    points[:4, :2] = [[-2, 0], [3, 0], [0, -1], [0, 1.5]]  # on the border, which is outside
    points[4] = np.nan
    return points


@pytest.mark.parametrize("columns", [3, 4, 5])
@pytest.mark.parametrize("is_inside", [False, True])
def test_crop_equals_a_mask(columns: int, is_inside: bool) -> None:
    points = scan(columns)
    x, y = points[:, 0], points[:, 1]
    mask = ((x > -2) & (x < 3) & (y > -1) & (y < 1.5)) == is_inside
    rows, cropped = crop(points, RECTANGLE, is_inside)
    np.testing.assert_array_equal(rows, np.flatnonzero(mask))
    np.testing.assert_array_equal(cropped, points[mask])


def test_crop_of_no_points_is_empty() -> None:
    rows, cropped = crop(np.zeros((0, 4), np.float32), RECTANGLE, True)
    assert rows.shape == (0,)
    assert cropped.shape == (0, 4)


def test_rows_within_planes_equal_a_mask_without_the_origin() -> None:
    points = scan(4)
    points[5:8, :3] = 0
    planes = np.array([[1, 0, 0.5, 2], [-1, 0, 0, 3], [0.5, 1, 0, 1], [0, -1, 1, 2]], np.float32)
    sides = points[:, :3].astype(np.float64) @ planes[:, :3].T + planes[:, 3]
    mask = (sides > 0).all(axis=1) & points[:, :3].any(axis=1)
    assert 50 < mask.sum() < 400
    np.testing.assert_array_equal(rows_within_planes(points, planes), np.flatnonzero(mask))
    assert rows_within_planes(points[:0], planes).shape == (0,)


def test_rows_within_a_mask_are_those_whose_pixels_are_in_front_and_on_it() -> None:
    points, rows = scan(4), np.arange(0, 500, 2)
    image_P_velo = np.array([[30.0, -40, 0, 1], [10, 0, -40, 2], [1, 0.1, 0, 0.5]])
    mask = np.random.default_rng(0).random((21, 61)) < 0.5
    pixels, depths_m = project(image_P_velo, points[rows])
    clipped = np.nan_to_num(np.clip(pixels, 0, (60, 20))).astype(np.int64)
    is_on = (depths_m > 1e-6) & (depths_m <= 6) & mask[clipped[:, 1], clipped[:, 0]]
    found = rows_within_mask(points, rows, image_P_velo, mask, 6.0)
    assert 20 < is_on.sum() < 200
    np.testing.assert_array_equal(found[0], rows[is_on])
    np.testing.assert_array_equal(found[1], points[rows[is_on], :3])
    np.testing.assert_allclose(found[2], pixels[is_on].T, rtol=1e-12)
    np.testing.assert_allclose(found[3], depths_m[is_on], rtol=1e-12)


def test_split_by_height_equals_masks() -> None:
    points, rows = scan(4), np.arange(500) * 3
    above_m = points[:, 2].copy()
    obstacles, obstacle_rows, ground_rows = split_by_height(points, rows, above_m, 0.2, 2.0)
    mask = (above_m >= np.float32(0.2)) & (above_m < 2)
    np.testing.assert_array_equal(obstacles, points[mask, :3])
    np.testing.assert_array_equal(obstacle_rows, rows[mask])
    np.testing.assert_array_equal(ground_rows, rows[above_m < np.float32(0.2)])
