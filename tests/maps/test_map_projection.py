"""Which pixel holds which return: homogeneous, rounded, the nearest wins, nothing from behind."""

from dataclasses import replace

import numpy as np
import pytest

from perception.errors import PerceptionError
from perception.maps.densify import densify
from perception.maps.projection import (
    VIRTUAL_CAMERA,
    SparseMaps,
    camera_of,
    project_frame,
    project_scan,
)
from perception.types import Calibration, Frame
from tests.reference.maps import project_by_loop

# x forward of the LiDAR is z of the camera; 10 px of focal length, principal point (8, 4), and an
# offset as KITTI's P2 has one.
CALIBRATION = Calibration(
    image_P_cam=np.array([[10.0, 0, 8, 2.0], [0, 10, 4, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
)
SIZE = (17, 9)


def points(*rows):
    return np.array(rows, np.float32).reshape(-1, 4)


def test_offset_of_the_projection_counts_whatever_the_reflectance():
    # u = 10 * (-y) / x + 8 + 2 / x = 8 + 2 / 2 at x = 2, whether it reflects or not.
    for reflectance in (0.0, 0.9):
        sparse = project_scan(points([2, 0, 0, reflectance]), CALIBRATION, SIZE)
        assert sparse.pixels.tolist() == [[9, 4]]
        assert sparse.depth_m.tolist() == [2.0]
        assert sparse.reflectance.tolist() == [np.float32(reflectance)]


def test_nearest_wins_a_pixel_whatever_the_order():
    near, far = [10, 0, 0, 0.2], [12, 0, 0, 0.7]
    for scan in (points(near, far), points(far, near)):
        sparse = project_scan(scan, CALIBRATION, SIZE)
        assert sparse.depth_m.tolist() == [10.0]
        assert sparse.scattered(sparse.reflectance).sum() == np.float32(0.2)
        assert np.argwhere(sparse.is_measured).tolist() == [[4, 8]]


def test_points_behind_beside_or_too_near_are_left_out():
    scan = points([-10, 0, 0, 1], [10, 30, 0, 1], [10, 0, 9, 1], [0.3, 0, 0, 1], [0, 0, 0, 1])
    assert len(project_scan(scan, CALIBRATION, SIZE)) == 0
    assert len(project_scan(points(), CALIBRATION, SIZE)) == 0


def test_equals_a_loop_over_points():
    generator = np.random.default_rng(3)
    scan = generator.uniform((-20, -20, -9, 0), (40, 20, 9, 1), (2000, 4)).astype(np.float32)
    sparse = project_scan(scan, CALIBRATION, SIZE)
    expected = project_by_loop(scan, CALIBRATION, SIZE)
    assert len(sparse) == len(expected) > 50
    for pixel, depth, reflectance in zip(
        sparse.pixels.tolist(), sparse.depth_m, sparse.reflectance, strict=True
    ):
        assert expected[tuple(pixel)] == pytest.approx((depth, reflectance), rel=1e-6)
    assert (np.diff(sparse.depth_m) <= 0).all()


def test_arrays_of_different_lengths_are_refused():
    with pytest.raises(PerceptionError) as error:
        SparseMaps(np.zeros((2, 2), int), np.ones(3, np.float32), np.ones(3, np.float32), SIZE)
    assert error.value.where == "SparseMaps.depth_m"
    assert (error.value.expected, error.value.found) == ("shape (2,)", "shape (3,)")


def test_points_that_are_not_numbers_are_not_seen():
    scan = points([10, 0, 0, 0.2], [np.nan, 0, 0, 0.5], [10, np.nan, 0.5, 0.5], [np.inf, 0, 0, 0.5])
    sparse = project_scan(scan, CALIBRATION, SIZE)
    assert sparse.depth_m.tolist() == [10.0]
    assert sparse.flat_indices.tolist() == [4 * 17 + 8]


def test_of_many_returns_in_one_pixel_the_nearest_stays_alone():
    generator = np.random.default_rng(4)
    # All within a tenth of a pixel of (8, 4) + the offset of 2 / x.
    scan = np.zeros((500, 4), np.float32)
    scan[:, 0], scan[:, 3] = generator.uniform(100, 300, 500), generator.uniform(0, 1, 500)
    scan = np.concatenate([scan, scan[::-1]])
    sparse = project_scan(scan, CALIBRATION, SIZE)
    nearest = scan[:, 0].argmin()
    assert sparse.pixels.tolist() == [[8, 4]]
    assert sparse.depth_m.tolist() == [scan[nearest, 0]]
    assert sparse.reflectance.tolist() == [scan[nearest, 3]]
    dense = densify(sparse)
    assert (dense.depth_m[4:] == scan[nearest, 0]).all()
    assert np.argwhere(dense.is_measured).tolist() == [[4, 8]]
    assert (~dense.is_valid[:4]).all()


def test_of_equals_in_one_pixel_the_first_stays():
    scan = points([10, 0, 0, 0.3], [10, 0, 0, 0.8], [10, 0, 0, 0.1])
    assert project_scan(scan, CALIBRATION, SIZE).reflectance.tolist() == [np.float32(0.3)]


def test_frame_without_a_calibration_has_the_virtual_camera():
    image = np.zeros((90, 160, 3), np.uint8)
    for bare in (
        Frame(0, 0.0, points([10, 0, 0, 0.5])),
        Frame(0, 0.0, points([9, 0, 0, 1]), image),
    ):
        camera, size_px = camera_of(bare)
        assert camera is VIRTUAL_CAMERA
        assert size_px == camera.image_size_px == (1242, 375)
    # It looks ahead: a return in the middle, at the height of the LiDAR, is above the middle of the image.
    sparse = project_frame(Frame(0, 0.0, points([10, 0, 0, 0.5], [-10, 0, 0, 0.5])))
    assert sparse.pixels[:, 0].tolist() == [610]
    assert 0 < sparse.pixels[0, 1] < 187


def test_size_of_the_image_is_that_of_the_image_else_stated_else_twice_the_principal_point():
    image = np.zeros((9, 17, 3), np.uint8)
    unstated = Frame(0, 0.0, points([10, 0, 0, 0.5]), calibration=CALIBRATION)
    assert camera_of(unstated)[1] == (16, 8)
    stated = replace(unstated, calibration=replace(CALIBRATION, image_size_px=(20, 10)))
    assert camera_of(stated)[1] == (20, 10)
    assert camera_of(replace(unstated, image=image))[1] == (17, 9)
