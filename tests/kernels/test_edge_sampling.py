"""Values and slopes between pixels, beside OpenCV's."""

import cv2
import numpy as np

from perception.kernels.edge_sampling import sample_maps


def test_values_are_those_of_opencv_and_slopes_their_differences():
    rng = np.random.default_rng(0)
    maps = rng.random((3, 20, 30), np.float32)
    frames = rng.integers(0, 3, 200)
    columns, rows = rng.uniform(0.1, 28.9, 200), rng.uniform(0.1, 18.9, 200)
    value, along_u, along_v = sample_maps(maps, frames, columns, rows)
    for k in range(200):
        at = np.float32([[columns[k]]]), np.float32([[rows[k]]])
        # OpenCV's places are rounded to 1/32 of a pixel.
        assert abs(cv2.remap(maps[frames[k]], *at, cv2.INTER_LINEAR)[0, 0] - value[k]) < 0.04
    inside = (np.abs(columns % 1 - 0.5) < 0.4) & (np.abs(rows % 1 - 0.5) < 0.4)
    ahead = sample_maps(maps, frames, columns + 0.05, rows)[0]
    below = sample_maps(maps, frames, columns, rows + 0.05)[0]
    np.testing.assert_allclose(along_u[inside], (ahead - value)[inside] / 0.05, atol=1e-5)
    np.testing.assert_allclose(along_v[inside], (below - value)[inside] / 0.05, atol=1e-5)


def test_places_outside_take_the_border_without_a_slope_across_it():
    maps = np.arange(12, dtype=np.float32).reshape(1, 3, 4)
    columns, rows = np.array([-2.0, 9.0, 1.0, np.nan]), np.array([0.0, 9.0, 7.0, 0.0])
    value, along_u, along_v = sample_maps(maps, np.zeros(4, np.int64), columns, rows)
    np.testing.assert_allclose(value, [0, 11, 9, 0])
    np.testing.assert_allclose(along_u, [0, 0, 1, 0])
    np.testing.assert_allclose(along_v, [4, 0, 0, 4])
