"""What is written of tracks, by numbers small enough to check by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest

from data.kitti.labels import read_tracking_labels
from data.kitti.tracking_rows import read_result_rows
from perception.cli.track_files import TrackFiles, track_line
from perception.geometry import se3
from perception.types import Boxes3D, Calibration, Frame, Obstacles, Result, Tracks, Voxels

CALIBRATION = Calibration(
    image_P_cam=np.array([[700.0, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, 0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    image_size_px=(1242, 375),
)
# A car ahead that was seen, and a walker behind, who is predicted.
TRACKS = Tracks(
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
    line = track_line(result)
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
    files = TrackFiles(tmp_path, "0000", CALIBRATION)
    files.write(result)
    line = json.loads((tmp_path / "tracks.jsonl").read_text())
    assert [track["id"] for track in line["tracks"]] == [4, 9]
    rows = read_result_rows(tmp_path / "tracks" / "0000.txt")
    # The walker is behind the camera.
    assert (rows.frames.tolist(), rows.ids.tolist(), rows.scores.tolist()) == ([7], [4], [1.0])
    boxes = read_tracking_labels(tmp_path / "tracks" / "0000.txt", CALIBRATION)[7].boxes_velo
    np.testing.assert_allclose(boxes.bottom_m, [[10.0, 2.0, -1.7]], atol=1e-5)
    files.close()


def test_a_frame_without_tracks_is_a_line_and_no_row(result, tmp_path):
    files = TrackFiles(tmp_path, "0000", CALIBRATION)
    files.write(replace(result, tracks=Tracks.empty()))
    files.close()
    assert json.loads((tmp_path / "tracks.jsonl").read_text())["tracks"] == []
    assert (tmp_path / "tracks" / "0000.txt").read_text() == ""


@pytest.mark.parametrize("calibration", [None, replace(CALIBRATION, image_size_px=None)])
def test_without_a_camera_there_are_no_benchmark_rows(result, tmp_path, calibration):
    (tmp_path / "tracks").mkdir()
    (tmp_path / "tracks" / "0000.txt").write_text("of an earlier run\n")
    files = TrackFiles(tmp_path, "0000", calibration)
    files.write(result)
    files.close()
    assert not (tmp_path / "tracks" / "0000.txt").exists()
    assert len((tmp_path / "tracks.jsonl").read_text().splitlines()) == 1
