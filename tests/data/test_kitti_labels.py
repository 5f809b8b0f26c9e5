"""Label rows to boxes in the LiDAR frame, and back."""

import numpy as np
import pytest

from data.kitti.calibration import read_benchmark_calibration
from data.kitti.labels import (
    empty_labels,
    format_object_labels,
    format_tracking_labels,
    read_object_labels,
    read_tracking_labels,
)
from perception.errors import LabelError
from perception.types import Boxes3D, Calibration, Labels
from tests.faults import fault

# Camera axes 8 cm over and 27 cm before the LiDAR.
CALIBRATION = Calibration(
    image_P_cam=np.array([[700.0, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, 0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
)
LABELS = Labels(
    boxes_velo=Boxes3D(
        bottom_m=np.array([[20.0, 5.0, -1.7], [8.0, -3.0, -1.6]]),
        size_m=np.array([[4.2, 1.8, 1.5], [0.8, 0.6, 1.75]]),
        yaw_rad=np.array([0.1, -2.5]),
    ),
    boxes_px=np.array([[300.0, 150.0, 450.0, 290.0], [800.0, 120.0, 850.0, 260.0]]),
    types=np.array(["Car", "Pedestrian"]),
    track_ids=np.array([4, 9]),
    truncation=np.array([0.0, 1.0]),
    occlusion=np.array([1, 2]),
    dont_care_px=np.array([[10.0, 20.0, 30.0, 40.0]]),
)


def test_tracking_labels_read_back_as_written(tmp_path):
    path = tmp_path / "0000.txt"
    path.write_text(format_tracking_labels(3, LABELS, CALIBRATION))

    read = read_tracking_labels(path, CALIBRATION)

    assert list(read) == [3]
    _assert_same(read[3])
    assert read[3].track_ids.tolist() == [4, 9]


def test_object_labels_read_back_as_written(tmp_path):
    path = tmp_path / "000000.txt"
    path.write_text(format_object_labels(LABELS, CALIBRATION))

    read = read_object_labels(path, CALIBRATION)

    _assert_same(read)
    assert read.track_ids.tolist() == [-1, -1]


def test_a_row_in_camera_axes_becomes_a_box_in_lidar_axes(tmp_path):
    # Heading to the camera's right (ry 0) is heading to the LiDAR's right (yaw -90 degrees).
    (tmp_path / "label.txt").write_text("Car 0 0 0 0 0 9 9 1.5 1.8 4.2 -5 1.78 19.73 0\n")
    boxes = read_object_labels(tmp_path / "label.txt", CALIBRATION).boxes_velo
    np.testing.assert_allclose(boxes.bottom_m, [[20, 5, -1.7]], atol=1e-12)
    np.testing.assert_allclose(boxes.size_m, [[4.2, 1.8, 1.5]])
    np.testing.assert_allclose(boxes.yaw_rad, [-np.pi / 2])


def test_a_frame_without_labels_writes_no_row_and_counts_none():
    assert len(empty_labels()) == 0
    assert format_object_labels(empty_labels(), CALIBRATION) == ""


@pytest.mark.parametrize(
    ("row", "expected", "found"),
    [
        ("0 1 Car 0 0 0 1 2 3", "17 columns, frame to ry", "9"),
        ("0 1 Car 0 0 0 1 2 3 4 x 6 7 8 9 0 1", "as height is", "'x'"),
        ("Car 0 0 0 0 0 9 9 1 1 4 -5 1 19 0", "17 columns, frame to ry", "15"),
    ],
    ids=["too short", "no number", "object row"],
)
def test_a_bad_row_is_named_with_its_file(tmp_path, row, expected, found):
    path = tmp_path / "0000.txt"
    path.write_text(f"{format_tracking_labels(0, LABELS, CALIBRATION)}{row}\n")
    with fault(LabelError, f"{path} row 4", expected, found):
        read_tracking_labels(path, CALIBRATION)


def test_official_rows_are_written_as_they_were_read(kitti_root, tmp_path):
    calibration = read_benchmark_calibration(kitti_root / "tracking/training/calib/0000.txt").camera
    official = kitti_root / "tracking/training/label_02/0000.txt"
    read = read_tracking_labels(official, calibration)

    text = "".join(format_tracking_labels(f, rows, calibration) for f, rows in read.items())

    rows = [sorted(map(str.split, t.splitlines())) for t in (official.read_text(), text)]
    assert [row[:5] for row in rows[0]] == [row[:5] for row in rows[1]]
    numbers = [np.array([row[5:] for row in side], float) for side in rows]
    np.testing.assert_allclose(numbers[0][:, 0], numbers[1][:, 0], atol=0.01)  # alpha
    np.testing.assert_allclose(numbers[0][:, 1:], numbers[1][:, 1:], atol=5e-6)


def _assert_same(read: Labels) -> None:
    np.testing.assert_allclose(read.boxes_velo.bottom_m, LABELS.boxes_velo.bottom_m, atol=2e-6)
    np.testing.assert_allclose(read.boxes_velo.size_m, LABELS.boxes_velo.size_m, atol=1e-6)
    np.testing.assert_allclose(read.boxes_velo.yaw_rad, LABELS.boxes_velo.yaw_rad, atol=1e-6)
    np.testing.assert_allclose(read.boxes_px, LABELS.boxes_px)
    np.testing.assert_allclose(read.truncation, LABELS.truncation)
    np.testing.assert_allclose(read.dont_care_px, LABELS.dont_care_px)
    assert read.types.tolist() == ["Car", "Pedestrian"]
    assert read.occlusion.tolist() == [1, 2]
