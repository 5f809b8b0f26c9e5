"""Values and slopes between pixels, beside OpenCV's, and their sums, beside NumPy's."""

import cv2
import numpy as np
import pytest

from perception.calibration.edge_alignment import offset_SE3
from perception.kernels.edge_sampling import add_map_sums, sample_map
from perception.types import Float32, Float64, Int

MIN_DEPTH_M = 0.1


def test_values_are_those_of_opencv_and_slopes_their_differences():
    rng = np.random.default_rng(0)
    maps = rng.random((3, 20, 30), np.float32)
    frames = rng.integers(0, 3, 200)
    columns, rows = rng.uniform(0.1, 28.9, 200), rng.uniform(0.1, 18.9, 200)
    value, along_u, along_v = _sampled(maps, frames, columns, rows)
    for k in range(200):
        at = np.float32([[columns[k]]]), np.float32([[rows[k]]])
        # OpenCV's places are rounded to 1/32 of a pixel.
        assert abs(cv2.remap(maps[frames[k]], *at, cv2.INTER_LINEAR)[0, 0] - value[k]) < 0.04
    inside = (np.abs(columns % 1 - 0.5) < 0.4) & (np.abs(rows % 1 - 0.5) < 0.4)
    ahead = _sampled(maps, frames, columns + 0.05, rows)[0]
    below = _sampled(maps, frames, columns, rows + 0.05)[0]
    np.testing.assert_allclose(along_u[inside], (ahead - value)[inside] / 0.05, atol=1e-5)
    np.testing.assert_allclose(along_v[inside], (below - value)[inside] / 0.05, atol=1e-5)


def test_places_outside_take_the_border_without_a_slope_across_it():
    maps = np.arange(12, dtype=np.float32).reshape(1, 3, 4)
    columns, rows = np.array([-2.0, 9.0, 1.0, np.nan]), np.array([0.0, 9.0, 7.0, 0.0])
    value, along_u, along_v = _sampled(maps, np.zeros(4, np.int64), columns, rows)
    np.testing.assert_allclose(value, [0, 11, 9, 0])
    np.testing.assert_allclose(along_u, [0, 0, 1, 0])
    np.testing.assert_allclose(along_v, [4, 0, 0, 4])


def test_sums_are_those_of_numpy():
    rng = np.random.default_rng(1)
    maps = rng.random((2, 40, 60), np.float32)
    projection = np.array([[40.0, 0, 30, 1], [0, 40, 20, -2], [0, 0, 1, 0.01]])
    map_P_cam = np.stack([projection, 1.1 * projection])
    # Some beside the maps, some behind the camera.
    points = rng.uniform([-8, -6, -2], [8, 6, 15], (300, 3))
    frames = rng.integers(0, 2, 300)
    moved = offset_SE3(np.array([0.02, -0.1, 0.3, 0.1, 0.2, -0.3]))
    sums = np.ones((2, 7))
    add_map_sums(maps, map_P_cam, points, frames, moved, MIN_DEPTH_M, sums)
    reference = _numpy_sums(maps, map_P_cam, points, frames, moved)
    assert np.abs(reference).min() > 1e-3
    np.testing.assert_allclose(sums, 1 + reference, rtol=1e-10)


def test_the_slopes_are_those_of_the_sums():
    maps = cv2.GaussianBlur(np.random.default_rng(2).random((40, 60), np.float32), (0, 0), 6)[None]
    map_P_cam = np.array([[[40.0, 0, 30, 0], [0, 40, 20, 0], [0, 0, 1, 0]]])
    points = np.random.default_rng(3).uniform([-2, -1, 5], [2, 1, 9], (50, 3))
    frames = np.zeros(50, np.int64)

    def sums(offset: Float64) -> Float64:
        found = np.zeros((1, 7))
        add_map_sums(maps, map_P_cam, points, frames, offset_SE3(offset), MIN_DEPTH_M, found)
        return found[0]

    slopes = sums(np.zeros(6))[1:]
    for axis in range(6):
        step = 1e-4 * np.eye(6)[axis]
        difference = (sums(step)[0] - sums(-step)[0]) / 2e-4
        assert slopes[axis] == pytest.approx(difference, rel=0.01, abs=0.01)


def _sampled(maps: Float32, frames: Int, columns: Float64, rows: Float64) -> Float64:
    """Return (3, K) values and slopes of K places."""
    places = zip(frames.tolist(), columns.tolist(), rows.tolist(), strict=True)
    return np.array([sample_map(maps, frame, u, v) for frame, u, v in places]).T


def _numpy_sums(
    maps: Float32, map_P_cam: Float64, points_cam: Float64, frames: Int, moved_SE3_cam: Float64
) -> Float64:
    """Return (F, 7) sums by passes of NumPy over all points."""
    turned = points_cam @ moved_SE3_cam[:3, :3].T
    points = turned + moved_SE3_cam[:3, 3]
    projections = map_P_cam[frames]
    ahead = np.einsum("kij,kj->ki", projections[:, :, :3], points) + projections[:, :, 3]
    depths_m = np.where(ahead[:, 2] > MIN_DEPTH_M, ahead[:, 2], np.nan)
    columns, rows = ahead[:, 0] / depths_m, ahead[:, 1] / depths_m
    value, along_u, along_v = _sampled(maps, frames, columns, rows)
    depths_m = np.where(np.isfinite(depths_m), depths_m, 1.0)
    columns, rows = np.nan_to_num(columns), np.nan_to_num(rows)
    slopes = np.column_stack([along_u, along_v, -along_u * columns - along_v * rows])
    of_point = np.einsum("ki,kij->kj", slopes / depths_m[:, None], projections[:, :, :3])
    terms = np.column_stack([value, np.cross(turned, of_point), of_point])
    sums = [np.bincount(frames, term, minlength=len(maps)) for term in terms.T]
    return np.column_stack(sums)
