"""Tracks to rows of the tracking benchmark, and back through the reader of labels."""

import numpy as np
import pytest

from data.kitti.calibration import read_benchmark_calibration
from data.kitti.labels import read_tracking_labels
from data.kitti.track_results import image_boxes, to_tracking_rows, types_by_volume
from data.kitti.tracking_rows import format_result_rows, read_result_rows
from perception.types import Boxes3D, Calibration, Tracks

SIZE_PX = (1242, 375)
# Camera axes 8 cm over and 27 cm before the LiDAR.
CALIBRATION = Calibration(
    image_P_cam=np.array([[700.0, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, 0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
)


def tracks_at(*rows):
    """Return tracks of x y z, length width height, yaw, whether it is seen."""
    table = np.array(rows, float).reshape(-1, 8)
    boxes = Boxes3D(table[:, :3], table[:, 3:6], table[:, 6])
    velocities = np.zeros((len(table), 2))
    return Tracks(np.arange(len(table)) + 3, boxes, velocities, table[:, 7] > 0)


CAR = (20.0, 5.0, -1.7, 4.2, 1.8, 1.5, 0.1, 1)
WALKER = (8.0, -3.0, -1.6, 0.8, 0.6, 1.75, -2.5, 0)
BEHIND = (-9.0, 1.0, -1.7, 4.2, 1.8, 1.5, 0.0, 1)
BESIDE = (5.0, 30.0, -1.7, 4.2, 1.8, 1.5, 0.0, 1)


def test_tracks_read_back_as_boxes_in_the_lidar_frame(tmp_path):
    tracks = tracks_at(CAR, WALKER)
    path = tmp_path / "tracks.txt"
    path.write_text(format_result_rows(to_tracking_rows(12, tracks, CALIBRATION, SIZE_PX)))

    read = read_tracking_labels(path, CALIBRATION)[12]

    assert read.track_ids.tolist() == [3, 4]
    assert read.types.tolist() == ["Car", "Pedestrian"]
    np.testing.assert_allclose(read.boxes_velo.bottom_m, tracks.boxes.bottom_m, atol=2e-6)
    np.testing.assert_allclose(read.boxes_velo.size_m, tracks.boxes.size_m, atol=1e-6)
    np.testing.assert_allclose(read.boxes_velo.yaw_rad, tracks.boxes.yaw_rad, atol=1e-6)
    rows = read_result_rows(path)
    assert rows.scores.tolist() == [1.0, 0.5]
    assert rows.truncation.tolist() == rows.occlusion.tolist() == [-1, -1]


def test_only_what_the_image_shows_is_written():
    rows = to_tracking_rows(0, tracks_at(CAR, BEHIND, BESIDE, WALKER), CALIBRATION, SIZE_PX)
    assert rows.ids.tolist() == [3, 6]
    assert len(to_tracking_rows(0, Tracks.empty(), CALIBRATION, SIZE_PX)) == 0


def test_the_image_box_is_around_the_projected_box():
    # 10 m before the camera, 2 m wide, 1 m high, its near side at 8 m.
    boxes = Boxes3D(np.array([[10.27, 0, -0.92]]), np.array([[4.0, 2.0, 1.0]]), np.zeros(1))
    near = (600 - 700 / 8, 180, 600 + 700 / 8, 180 + 700 / 8)
    np.testing.assert_allclose(image_boxes(boxes, CALIBRATION, SIZE_PX), [near])


def test_a_box_partly_behind_the_camera_ends_at_the_image():
    # A long one on the right, from 10 m behind to 10 m ahead: it fills the right of the image.
    boxes = Boxes3D(np.array([[0.27, -3.0, -1.0]]), np.array([[20.0, 2.0, 3.0]]), np.zeros(1))
    x1, y1, x2, y2 = image_boxes(boxes, CALIBRATION, SIZE_PX)[0]
    assert x1 == pytest.approx(600 + 700 * 2 / 10)
    assert (y1, x2, y2) == (0, 1241, 374)


@pytest.mark.parametrize(
    ("size_m", "name"),
    [
        ((1.0, 1.0, 1.8), "Pedestrian"),
        ((1.0, 1.0, 1.9), "Cyclist"),
        ((2.0, 1.0, 2.0), "Cyclist"),
        ((4.2, 1.8, 1.5), "Car"),
    ],
)
def test_types_follow_the_volume(size_m, name):
    boxes = Boxes3D(np.zeros((1, 3)), np.array([size_m]), np.zeros(1))
    assert types_by_volume(boxes).tolist() == [name]


def test_labelled_boxes_as_tracks_give_the_labelled_image_boxes(kitti_root):
    folder = kitti_root / "tracking/training"
    calibration = read_benchmark_calibration(folder / "calib/0000.txt").camera
    for frame, labels in read_tracking_labels(folder / "label_02/0000.txt", calibration).items():
        count = len(labels)
        tracks = Tracks(
            labels.track_ids, labels.boxes_velo, np.zeros((count, 2)), np.ones(count, bool)
        )
        rows = to_tracking_rows(frame, tracks, calibration, SIZE_PX)
        whole = labels.truncation == 0
        assert np.isin(labels.track_ids[whole], rows.ids).all()
        mine = rows.boxes_px[np.isin(rows.ids, labels.track_ids[whole])]
        # Annotators drew the boxes of the image by hand, some of them around what is visible.
        assert np.median(np.abs(mine - labels.boxes_px[whole])) < 8
