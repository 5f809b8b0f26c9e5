"""Calibration texts, both spellings, read back as written, and refused by name."""

from dataclasses import replace

import numpy as np
import pytest

from data.kitti.calibration import (
    DriveCalibration,
    format_benchmark_calibration,
    format_raw_calibration,
    read_benchmark_calibration,
    read_raw_calibration,
    with_kitti_image_size,
)
from data.open_drive import open_drive
from perception.errors import CalibrationError
from perception.geometry.se3 import from_euler
from perception.maps.projection import camera_of
from perception.types import Calibration
from tests.faults import fault

# LiDAR x forward, y left, z up to camera x right, y down, z forward.
AXES = np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]])
CALIBRATION = DriveCalibration(
    camera=Calibration(
        image_P_cam=np.array([[721.5, 0, 609.5, 44.8], [0, 721.5, 172.8, 0.2], [0, 0, 1, 0.003]]),
        cam_SE3_velo=AXES @ from_euler(0.01, -0.02, 0.005),
        image_size_px=(1242, 375),
    ),
    velo_SE3_imu=from_euler(0.001, 0.002, -0.003, np.array([-0.81, 0.32, -0.8])),
)


def test_a_benchmark_text_reads_back_as_written(tmp_path):
    (tmp_path / "0000.txt").write_text(format_benchmark_calibration(CALIBRATION))
    _assert_same(read_benchmark_calibration(tmp_path / "0000.txt"))


def test_raw_texts_read_back_as_written(tmp_path):
    for name, text in format_raw_calibration(CALIBRATION).items():
        (tmp_path / name).write_text(text)
    read = read_raw_calibration(tmp_path)
    _assert_same(read)
    assert read.camera.image_size_px == (1242, 375)


def test_the_other_official_spelling_reads_the_same(tmp_path):
    text = format_benchmark_calibration(CALIBRATION)
    text = text.replace("R0_rect:", "R_rect").replace("Tr_velo_to_cam:", "Tr_velo_cam")
    (tmp_path / "0000.txt").write_text(text.replace("Tr_imu_to_velo:", "Tr_imu_velo"))
    _assert_same(read_benchmark_calibration(tmp_path / "0000.txt"))


def test_image_size_is_that_stated_else_that_of_the_recordings_with_this_focal_length():
    camera = replace(CALIBRATION.camera, image_size_px=None)
    assert with_kitti_image_size(camera).image_size_px is None
    matrix = camera.image_P_cam.copy()
    matrix[0, 0] = 707.0493
    camera = replace(camera, image_P_cam=matrix)
    assert with_kitti_image_size(camera).image_size_px == (1224, 370)
    stated = replace(camera, image_size_px=(612, 185))
    assert with_kitti_image_size(stated).image_size_px == (612, 185)


def test_maps_do_not_depend_on_whether_there_are_images(kitti_root):
    frames, bare = (open_drive(kitti_root / "object", images=images) for images in (True, False))
    for index in range(len(frames)):
        assert camera_of(bare[index])[1] == camera_of(frames[index])[1]


def test_what_a_raw_folder_does_not_state_is_none(tmp_path):
    assert read_raw_calibration(tmp_path) == DriveCalibration(None, None)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "Tr_velo_to_cam:",
            "Tr_else:",
            "the key Tr_velo_to_cam or Tr_velo_cam or Tr, found only P0",
        ),
        ("P2: 7", "P2: x", "expected 12 numbers after P2, found 'x"),
        ("P2: 7", "P2: nan 7", "expected 12 finite numbers after P2, found 12"),
    ],
    ids=["missing key", "no number", "not finite"],
)
def test_a_bad_row_is_named_with_its_file(tmp_path, old, new, sentence):
    path = tmp_path / "0000.txt"
    path.write_text(format_benchmark_calibration(CALIBRATION).replace(old, new))
    with pytest.raises(CalibrationError) as error:
        read_benchmark_calibration(path)
    assert str(error.value).startswith(f"{path}: ")
    assert sentence in str(error.value)


@pytest.mark.parametrize("key", ["P2", "R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo"])
def test_a_singular_matrix_is_named_with_its_file(tmp_path, key):
    path = tmp_path / "0000.txt"
    lines = format_benchmark_calibration(CALIBRATION).splitlines()
    zeros = "0 " * (9 if key == "R0_rect" else 12)
    path.write_text("\n".join(f"{key}: {zeros}" if row.startswith(key) else row for row in lines))
    with fault(CalibrationError, str(path), f"an invertible {key}", "a singular matrix"):
        read_benchmark_calibration(path)


def test_a_missing_file_is_named(tmp_path):
    with fault(CalibrationError, where="0007.txt", found="no file"):
        read_benchmark_calibration(tmp_path / "0007.txt")


def test_the_real_raw_and_tracking_calibrations_agree(kitti_root):
    raw = read_raw_calibration(kitti_root / "raw/2011_09_26")
    tracking = read_benchmark_calibration(kitti_root / "tracking/training/calib/0000.txt")
    np.testing.assert_allclose(raw.camera.image_P_velo, tracking.camera.image_P_velo, atol=1e-9)
    np.testing.assert_allclose(raw.velo_SE3_imu, tracking.velo_SE3_imu, atol=1e-9)


def _assert_same(read: DriveCalibration) -> None:
    np.testing.assert_allclose(read.camera.image_P_cam, CALIBRATION.camera.image_P_cam)
    np.testing.assert_allclose(
        read.camera.cam_SE3_velo, CALIBRATION.camera.cam_SE3_velo, atol=1e-12
    )
    np.testing.assert_allclose(read.velo_SE3_imu, CALIBRATION.velo_SE3_imu, atol=1e-12)
