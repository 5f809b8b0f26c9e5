import numpy as np
import pytest

from perception.geometry.camera import project
from perception.tracking.single_object.fusion.fusion_tracker import back_project

# Looks along +x from 30 cm before the LiDAR and 20 cm to its side; x right is -y, y down is -z.
FOCAL_PX = 700.0
INTRINSIC = np.array([[FOCAL_PX, 0, 600], [0, FOCAL_PX, 180], [0, 0, 1]])
CAM_R_VELO = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
IMAGE_P_VELO = INTRINSIC @ np.column_stack([CAM_R_VELO, CAM_R_VELO @ (-0.3, -0.2, 0.1)])


def pixel_of(point: np.ndarray) -> np.ndarray:
    return project(IMAGE_P_VELO, point[None])[0][0]


def test_over_a_plane_that_faces_the_camera_the_position_is_exact(rng):
    plane = np.column_stack([np.full(200, 10.0), rng.uniform(-2, 2, (200, 2))])
    expected = np.array([10, 0.3, 0.4])
    np.testing.assert_allclose(
        back_project(pixel_of(expected), plane, IMAGE_P_VELO), expected, atol=1e-9
    )


def test_the_position_is_the_bilinear_mean_of_the_points():
    # Columns and rows from the pixel, clockwise from the upper left; the upper pair is 8 m away, the lower 12 m.
    away_px = np.array([[-10, -20], [30, -20], [-10, 20], [30, 20]])
    camera_m = np.array([0.3, 0.2, -0.1])
    depths_m = np.array([8.0, 8.0, 12.0, 12.0])
    right_m, down_m = (away_px * depths_m[:, None] / FOCAL_PX).T
    points = camera_m + np.column_stack([depths_m, -right_m, -down_m])
    found = back_project(np.array([600.0, 180.0]), points, IMAGE_P_VELO)
    np.testing.assert_allclose(found, np.array([0.75, 0.25, 0.75, 0.25]) @ points / 2, atol=1e-9)
    assert found[0] == pytest.approx(10.3)


def test_the_position_lies_between_the_points(rng):
    points = np.column_stack([rng.uniform(8, 12, 50), rng.uniform(-2, 2, (50, 2))])
    center_px = np.array([612.0, 171.0])
    found = back_project(center_px, points, IMAGE_P_VELO)
    assert np.hypot(*(pixel_of(found) - center_px)) < 20
    assert 8 < found[0] < 12


def test_only_the_nearest_of_each_quadrant_counts():
    near = np.array([[10, 0.1, 0.1], [10, -0.1, 0.1], [10, 0.1, -0.1], [10, -0.1, -0.1]])
    far = near * (2.0, 8.0, 8.0)
    center_px = pixel_of(np.array([10.0, 0.0, 0.0]))
    found = back_project(center_px, np.vstack([far, near]), IMAGE_P_VELO)
    np.testing.assert_allclose(found, [10, 0, 0], atol=1e-9)


def test_with_fewer_quadrants_those_there_are_weigh_the_same():
    left_only = np.array([[8.0, 1.0, 1.0], [12.0, 1.0, -1.0]])
    center_px = pixel_of(np.array([10.0, 0.0, 0.0]))
    found = back_project(center_px, left_only, IMAGE_P_VELO)
    np.testing.assert_allclose(found, [10, 1, 0], atol=1e-9)


def test_one_point_at_the_pixel_is_that_point():
    point = np.array([9.0, 0.5, -0.5])
    np.testing.assert_allclose(
        back_project(pixel_of(point), point[None], IMAGE_P_VELO), point, atol=1e-9
    )


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.array([[-5.0, 0, 0]])])
def test_without_a_point_in_front_of_the_camera_there_is_no_position(points):
    assert back_project(np.array([600.0, 180.0]), points, IMAGE_P_VELO) is None


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(8)
