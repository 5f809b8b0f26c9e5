"""Values and slopes between pixels, beside OpenCV's, and their sums, beside NumPy's."""

import cv2
import numpy as np
import pytest

from perception.geometry.se3 import from_motion_vector
from perception.kernels.edge_sampling import add_map_sums, sample_map
from perception.types import Float32, Float64

MIN_DEPTH_M = 0.1
MAP_P_CAM = np.array([[40.0, 0, 30, 1], [0, 40, 20, -2], [0, 0, 1, 0.01]])


def test_values_are_those_of_opencv_and_slopes_their_differences():
    rng = np.random.default_rng(0)
    edges = rng.random((20, 30), np.float32)
    columns, rows = rng.uniform(0.1, 28.9, 200), rng.uniform(0.1, 18.9, 200)
    value, along_u, along_v = _sampled(edges, columns, rows)
    for k in range(200):
        at = np.float32([[columns[k]]]), np.float32([[rows[k]]])
        # OpenCV's places are rounded to 1/32 of a pixel.
        assert abs(cv2.remap(edges, *at, cv2.INTER_LINEAR)[0, 0] - value[k]) < 0.04
    inside = (np.abs(columns % 1 - 0.5) < 0.4) & (np.abs(rows % 1 - 0.5) < 0.4)
    ahead = _sampled(edges, columns + 0.05, rows)[0]
    below = _sampled(edges, columns, rows + 0.05)[0]
    np.testing.assert_allclose(along_u[inside], (ahead - value)[inside] / 0.05, atol=1e-5)
    np.testing.assert_allclose(along_v[inside], (below - value)[inside] / 0.05, atol=1e-5)


def test_places_outside_take_the_border_without_a_slope_across_it():
    edges = np.arange(12, dtype=np.float32).reshape(3, 4)
    columns, rows = np.array([-2.0, 9.0, 1.0, np.nan]), np.array([0.0, 9.0, 7.0, 0.0])
    value, along_u, along_v = _sampled(edges, columns, rows)
    np.testing.assert_allclose(value, [0, 11, 9, 0])
    np.testing.assert_allclose(along_u, [0, 0, 1, 0])
    np.testing.assert_allclose(along_v, [4, 0, 0, 4])


def test_sums_are_those_of_numpy():
    rng = np.random.default_rng(1)
    maps = rng.random((2, 40, 60), np.float32)
    is_first = rng.random(300) < 0.4
    # Some points beside the map, some behind the camera.
    points = rng.uniform([-8, -6, -2], [8, 6, 15], (300, 3))
    moved = from_motion_vector(np.array([0.02, -0.1, 0.3, 0.1, 0.2, -0.3]))
    sums = np.ones(7)
    add_map_sums(maps, is_first, MAP_P_CAM, points, moved, MIN_DEPTH_M, sums)
    reference = sum(
        _numpy_sums(edges, points[is_its], moved)
        for edges, is_its in zip(maps, (is_first, ~is_first), strict=True)
    )
    assert np.abs(reference).min() > 1e-3
    np.testing.assert_allclose(sums, 1 + reference, rtol=1e-10)


def test_the_slopes_are_those_of_the_sums():
    edges = cv2.GaussianBlur(np.random.default_rng(2).random((40, 60), np.float32), (0, 0), 6)
    points = np.random.default_rng(3).uniform([-2, -1, 5], [2, 1, 9], (50, 3))

    def sums(offset: Float64) -> Float64:
        found = np.zeros(7)
        is_first = np.ones(len(points), bool)
        add_map_sums(
            edges[None], is_first, MAP_P_CAM, points, from_motion_vector(offset), MIN_DEPTH_M, found
        )
        return found

    slopes = sums(np.zeros(6))[1:]
    for axis in range(6):
        step = 1e-4 * np.eye(6)[axis]
        difference = (sums(step)[0] - sums(-step)[0]) / 2e-4
        assert slopes[axis] == pytest.approx(difference, rel=0.01, abs=0.01)


def _sampled(edges: Float32, columns: Float64, rows: Float64) -> Float64:
    """Return (3, K) values and slopes of K places."""
    return np.array(
        [
            sample_map(edges[None], 0, u, v)
            for u, v in zip(columns.tolist(), rows.tolist(), strict=True)
        ]
    ).T


def _numpy_sums(edges: Float32, points_cam: Float64, moved_SE3_cam: Float64) -> Float64:
    """Return (7,) sums by passes of NumPy over all points."""
    turned = points_cam @ moved_SE3_cam[:3, :3].T
    ahead = (turned + moved_SE3_cam[:3, 3]) @ MAP_P_CAM[:, :3].T + MAP_P_CAM[:, 3]
    depths_m = np.where(ahead[:, 2] > MIN_DEPTH_M, ahead[:, 2], np.nan)
    columns, rows = ahead[:, 0] / depths_m, ahead[:, 1] / depths_m
    value, along_u, along_v = _sampled(edges, columns, rows)
    depths_m = np.where(np.isfinite(depths_m), depths_m, 1.0)
    columns, rows = np.nan_to_num(columns), np.nan_to_num(rows)
    slopes = np.column_stack([along_u, along_v, -along_u * columns - along_v * rows])
    of_point = slopes / depths_m[:, None] @ MAP_P_CAM[:, :3]
    return np.column_stack([value, np.cross(turned, of_point), of_point]).sum(axis=0)
