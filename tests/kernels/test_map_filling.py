"""The compiled projection beside its loop; the filling is compared with its loop in tests/maps/test_densify.py."""

import numpy as np

from perception.kernels.map_filling import highest_rows, project_nearest
from perception.maps.projection import VIRTUAL_CAMERA


def test_projection_equals_the_reference_the_farthest_first() -> None:
    random = np.random.default_rng(0)
    points = random.uniform((0, -6, -2, 0), (20, 6, 2, 1), (3000, 4)).astype(np.float32)
    points[::7] = points[1::7][: len(points[::7])] * np.float32(1.5)
    width, height = 120, 60
    camera = np.diag([0.1, 0.16, 1]) @ VIRTUAL_CAMERA.image_P_velo
    pixels, depth_m, reflectance = project_nearest(points, camera, width, height, 0.5)
    expected: dict[tuple[int, int], tuple[float, float]] = {}
    for x, y, z, bright in points.astype(np.float64):
        u, v, depth = camera @ (x, y, z, 1)
        pixel = round(u / depth), round(v / depth)
        inside = depth > 0.5 and 0 <= pixel[0] < width and 0 <= pixel[1] < height
        if inside and depth < expected.get(pixel, (np.inf, 0))[0]:
            expected[pixel] = depth, bright
    found = dict(
        zip(map(tuple, pixels.T.tolist()), zip(depth_m, reflectance, strict=True), strict=True)
    )
    assert found.keys() == expected.keys()
    for pixel, values in expected.items():
        np.testing.assert_allclose(found[pixel], values, rtol=1e-5)
    assert (np.diff(depth_m) <= 0).all()


def test_points_without_a_return_are_left_out() -> None:
    behind = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 2]])
    points = np.zeros((5, 4), np.float32)
    assert project_nearest(points, behind, 4, 4, 0.5)[0].shape == (2, 0)


def test_the_highest_pixel_of_each_column() -> None:
    columns, rows = np.array([1, 3, 1], np.int32), np.array([5, 2, 4], np.int32)
    np.testing.assert_array_equal(highest_rows(columns, rows, 4, 9), [9, 4, 9, 2])
