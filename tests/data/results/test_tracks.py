"""Tracks as JSON Lines and as rows of KITTI's tracking benchmark, with numbers to check by hand."""

from dataclasses import replace

import numpy as np
import pytest

from data.kitti.calibration import read_benchmark_calibration
from data.kitti.labels import read_tracking_labels
from data.kitti.tracking_rows import format_result_rows, read_result_rows
from data.results.documents import to_serializable
from data.results.records import LineFiles, read_records
from data.results.tracks import (
    FrameTracks,
    append_tracks,
    to_tracking_rows,
    types_by_volume,
)
from perception.geometry import se3
from perception.geometry.camera import box_outlines_px
from perception.types import Boxes3D, Calibration, Frame, Obstacles, Result, Tracks, Voxels

CALIBRATION = Calibration(
    image_P_cam=np.array([[700.0, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, 0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    image_size_px=(1242, 375),
)
# A car ahead that was seen, and a walker behind, who is predicted.
TRACKS = Tracks.unclassified(
    np.array([4, 9]),
    Boxes3D(
        np.array([[10.0, 2.0, -1.7], [-8.0, -1.0, -1.6]]),
        np.array([[4.2, 1.8, 1.5], [0.8, 0.6, 1.75]]),
        np.array([0.0, 3.0]),
    ),
    np.array([[3.0, 4.0], [0.0, -1.0]]),
    np.array([True, False]),
)
EMPTY = Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), 0.1)


@pytest.fixture
def result():
    # The vehicle is at (100, 50, 3) and heads along the world's y.
    pose = se3.from_euler(0, 0, np.pi / 2, np.array([100.0, 50.0, 3.0]))
    frame = Frame(7, 0.7, np.ones((1, 4), np.float32), calibration=CALIBRATION)
    return Result(frame, pose, None, Obstacles(np.zeros(1, np.uint8), EMPTY, EMPTY), TRACKS)


def test_a_line_holds_every_track_in_the_world_and_in_the_lidar_frame(result):
    line = to_serializable(FrameTracks.of(result))
    assert (line["frame"], line["stamp_s"]) == (7, 0.7)
    car, walker = line["tracks"]
    assert car == {
        "id": 4,
        "is_observed": True,
        "size_m": [4.2, 1.8, 1.5],
        "speed_m_s": 5.0,
        "velo": {"position_m": [10.0, 2.0, -1.7], "yaw_rad": 0.0},
        "world": {
            "position_m": [98.0, 60.0, 1.3],
            "yaw_rad": pytest.approx(np.pi / 2, abs=1e-6),
            "velocity_m_s": [-4.0, 3.0, 0.0],
        },
    }
    assert (walker["id"], walker["is_observed"], walker["speed_m_s"]) == (9, False, 1.0)
    # 3 rad and a quarter turn are more than half a turn.
    assert walker["world"]["yaw_rad"] == pytest.approx(3 + np.pi / 2 - 2 * np.pi, abs=1e-6)


def test_the_files_are_whole_after_every_frame(result, tmp_path):
    files = LineFiles(tmp_path)
    append_tracks(files, "0000", CALIBRATION, result)
    assert read_records(tmp_path / "tracks.jsonl", FrameTracks) == [FrameTracks.of(result)]
    rows = read_result_rows(tmp_path / "tracks" / "0000.txt")
    # The walker is behind the camera.
    assert (rows.frames.tolist(), rows.ids.tolist(), rows.scores.tolist()) == ([7], [4], [1.0])
    boxes = read_tracking_labels(tmp_path / "tracks" / "0000.txt", CALIBRATION)[7].boxes_velo
    np.testing.assert_allclose(boxes.bottom_m, [[10.0, 2.0, -1.7]], atol=1e-5)


def test_a_frame_without_tracks_is_a_line_and_no_row(result, tmp_path):
    files = LineFiles(tmp_path)
    append_tracks(files, "0000", CALIBRATION, replace(result, tracks=Tracks.empty()))
    (line,) = read_records(tmp_path / "tracks.jsonl", FrameTracks)
    assert line.tracks == []
    assert (tmp_path / "tracks" / "0000.txt").read_text() == ""


@pytest.mark.parametrize("calibration", [None, replace(CALIBRATION, image_size_px=None)])
def test_without_a_camera_there_are_no_benchmark_rows(result, tmp_path, calibration):
    (tmp_path / "tracks").mkdir()
    (tmp_path / "tracks" / "0000.txt").write_text("of an earlier run\n")
    files = LineFiles(tmp_path)
    append_tracks(files, "0000", calibration, result)
    assert not (tmp_path / "tracks" / "0000.txt").exists()
    assert len((tmp_path / "tracks.jsonl").read_text().splitlines()) == 1


SIZE_PX = (1242, 375)
# Camera axes 8 cm above and 27 cm before the LiDAR.
BARE = replace(CALIBRATION, image_size_px=None)


def tracks_at(*rows):
    """Return tracks of x y z, length width height, yaw, whether it is seen."""
    table = np.array(rows, float).reshape(-1, 8)
    boxes = Boxes3D(table[:, :3], table[:, 3:6], table[:, 6])
    velocities = np.zeros((len(table), 2))
    return Tracks.unclassified(np.arange(len(table)) + 3, boxes, velocities, table[:, 7] > 0)


CAR = (20.0, 5.0, -1.7, 4.2, 1.8, 1.5, 0.1, 1)
WALKER = (8.0, -3.0, -1.6, 0.8, 0.6, 1.75, -2.5, 0)
BEHIND = (-9.0, 1.0, -1.7, 4.2, 1.8, 1.5, 0.0, 1)
BESIDE = (5.0, 30.0, -1.7, 4.2, 1.8, 1.5, 0.0, 1)


def test_tracks_read_back_as_boxes_in_the_lidar_frame(tmp_path):
    tracks = tracks_at(CAR, WALKER)
    path = tmp_path / "tracks.txt"
    path.write_text(format_result_rows(to_tracking_rows(12, tracks, BARE, SIZE_PX)))

    read = read_tracking_labels(path, BARE)[12]

    assert read.track_ids.tolist() == [3, 4]
    assert read.types.tolist() == ["Car", "Pedestrian"]
    np.testing.assert_allclose(read.boxes_velo.bottom_m, tracks.boxes.bottom_m, atol=2e-6)
    np.testing.assert_allclose(read.boxes_velo.size_m, tracks.boxes.size_m, atol=1e-6)
    np.testing.assert_allclose(read.boxes_velo.yaw_rad, tracks.boxes.yaw_rad, atol=1e-6)
    rows = read_result_rows(path)
    assert rows.scores.tolist() == [1.0, 0.5]
    assert rows.truncation.tolist() == rows.occlusion.tolist() == [-1, -1]


def test_only_what_the_image_shows_is_written():
    rows = to_tracking_rows(0, tracks_at(CAR, BEHIND, BESIDE, WALKER), BARE, SIZE_PX)
    assert rows.ids.tolist() == [3, 6]
    assert len(to_tracking_rows(0, Tracks.empty(), BARE, SIZE_PX)) == 0


def test_the_image_box_is_around_the_projected_box():
    # 10 m before the camera, 2 m wide, 1 m high, its near side at 8 m.
    boxes = Boxes3D(np.array([[10.27, 0, -0.92]]), np.array([[4.0, 2.0, 1.0]]), np.zeros(1))
    near = (600 - 700 / 8, 180, 600 + 700 / 8, 180 + 700 / 8)
    np.testing.assert_allclose(box_outlines_px(BARE.image_P_velo, boxes, SIZE_PX), [near])


def test_a_box_partly_behind_the_camera_ends_at_the_image():
    # A long one on the right, from 10 m behind to 10 m ahead: it fills the right of the image.
    boxes = Boxes3D(np.array([[0.27, -3.0, -1.0]]), np.array([[20.0, 2.0, 3.0]]), np.zeros(1))
    x1, y1, x2, y2 = box_outlines_px(BARE.image_P_velo, boxes, SIZE_PX)[0]
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
        tracks = Tracks.unclassified(
            labels.track_ids, labels.boxes_velo, np.zeros((count, 2)), np.ones(count, bool)
        )
        rows = to_tracking_rows(frame, tracks, calibration, SIZE_PX)
        whole = labels.truncation == 0
        assert np.isin(labels.track_ids[whole], rows.ids).all()
        mine = rows.boxes_px[np.isin(rows.ids, labels.track_ids[whole])]
        # Annotators drew the boxes of the image by hand, some of them around what is visible.
        assert np.median(np.abs(mine - labels.boxes_px[whole])) < 8
