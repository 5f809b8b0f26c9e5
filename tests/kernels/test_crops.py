"""Compiled crops and heights, each beside a plain form."""

import cv2
import numpy as np
import pytest

from perception.detection.depthcn.crops import warp, window_maps
from perception.kernels.crops import crop_nearest, encode_heights, nearest_places


def windows(seed: int, count: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    corner = random.uniform((-60, -30), (120, 80), (count, 2))
    # Whole numbers, too: places half-way between two pixels.
    corner[::2] = np.rint(corner[::2])
    size = np.where(np.arange(count)[:, None] % 4, random.uniform(1, 200, (count, 2)), (112, 66))
    return np.hstack([corner, corner + size])


@pytest.mark.skipif(cv2.__version__ < "5", reason="OpenCV 4 rounds other places")
def test_crops_are_those_of_a_warp_to_the_nearest_pixel():
    image = np.random.default_rng(0).integers(0, 256, (80, 130, 3), np.uint8)
    maps = window_maps(windows(1, 40))
    crops = np.full((40, 3, 66, 112), 7, np.uint8)
    crop_nearest(np.ascontiguousarray(image.transpose(2, 0, 1)), maps, crops)
    expected = [warp(image, one).transpose(2, 0, 1) for one in maps]
    np.testing.assert_array_equal(crops, expected)
    assert crops.any(axis=(1, 2, 3)).mean() > 0.9


def test_places_beyond_the_image_are_marked():
    assert nearest_places(-1.6, 1.0, 5, 2).tolist() == [-1, -1, 0, 1, -1]
    assert nearest_places(1e300, 1e300, 2, 2).tolist() == [-1, -1]


def test_heights_equal_a_rounded_plane():
    random = np.random.default_rng(2)
    depth_m = random.uniform(0, 60, (30, 40)).astype(np.float32)
    rows, columns = (random.uniform(-2, 2, n).astype(np.float32) for n in (30, 40))
    heights = np.empty((30, 40), np.uint8)
    encode_heights(depth_m, rows, columns, 100.0, heights)
    exact = depth_m * (rows[:, None] + columns).astype(float) + 100
    expected = np.clip(np.rint(exact), 1, 255)
    is_close_call = np.abs(exact - np.floor(exact) - 0.5) < 1e-3
    np.testing.assert_array_equal(heights[~is_close_call], expected[~is_close_call])
    assert {1, 255} <= set(heights.ravel().tolist())
