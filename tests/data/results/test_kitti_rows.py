"""Objects as rows of KITTI's tracking and object benchmarks, by the formats' rules, and back through our readers."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from data.kitti.calibration import read_benchmark_calibration
from data.kitti.detection_rows import read_detection_set
from data.kitti.labels import read_object_labels, read_tracking_labels
from data.kitti.tracking_rows import format_result_rows, read_result_rows
from data.results.kitti_rows import (
    format_object_rows,
    track_rows,
    trajectory_rows,
    types_by_volume,
    vehicle_rows,
)
from data.results.run_folder import append_kitti_rows
from perception.evaluation.detection.box_rows import (
    DetectedBoxes,
    LocatedDetections,
    TrueBoxes,
)
from perception.geometry.boxes import usual_observation_angles_rad
from perception.geometry.camera import box_outlines_px
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import (
    BoxDeviations,
    Boxes3D,
    Calibration,
    Detections,
    Frame,
    FusedDetections,
    Obstacles,
    Result,
    Tracks,
    Vehicles,
    Voxels,
)

SIZE_PX = (1242, 375)
# Camera axes 8 cm above and 27 cm before the LiDAR.
CALIBRATION = Calibration(
    image_P_cam=np.array([[700.0, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, 0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    image_size_px=SIZE_PX,
)
EMPTY = Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), 0.1)


def result_of(tracks: Tracks) -> Result:
    frame = Frame(7, 0.7, np.ones((1, 4), np.float32))
    return Result(frame, np.eye(4), None, Obstacles(np.zeros(1, np.uint8), EMPTY, EMPTY), tracks)


def drive_of(calibration: Calibration | None) -> SimpleNamespace:
    return SimpleNamespace(name="0000", calibration=calibration, is_sequence=True)


def test_rows_are_appended_frame_by_frame(tmp_path):
    path = tmp_path / "tracks" / "0000.txt"
    drive = drive_of(CALIBRATION)
    append_kitti_rows(tmp_path, drive, result_of(Tracks.empty()))
    assert path.read_text() == ""
    append_kitti_rows(tmp_path, drive, result_of(tracks_at(CAR, BEHIND)))
    rows = read_result_rows(path)
    assert (rows.frames.tolist(), rows.ids.tolist(), rows.scores.tolist()) == ([7], [3], [1.0])


@pytest.mark.parametrize("calibration", [None, replace(CALIBRATION, image_size_px=None)])
def test_without_a_camera_there_are_no_benchmark_rows(tmp_path, calibration):
    append_kitti_rows(tmp_path, drive_of(calibration), result_of(tracks_at(CAR)))
    assert list(tmp_path.iterdir()) == []


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
    path.write_text(format_result_rows(track_rows(12, tracks, CALIBRATION)))

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
    rows = track_rows(0, tracks_at(CAR, BEHIND, BESIDE, WALKER), CALIBRATION)
    assert rows.ids.tolist() == [3, 6]
    assert len(track_rows(0, Tracks.empty(), CALIBRATION)) == 0


def test_the_image_box_is_around_the_projected_box():
    # 10 m before the camera, 2 m wide, 1 m high, its near side at 8 m.
    boxes = Boxes3D(np.array([[10.27, 0, -0.92]]), np.array([[4.0, 2.0, 1.0]]), np.zeros(1))
    near = (600 - 700 / 8, 180, 600 + 700 / 8, 180 + 700 / 8)
    np.testing.assert_allclose(box_outlines_px(CALIBRATION.image_P_velo, boxes, SIZE_PX), [near])


def test_a_box_partly_behind_the_camera_ends_at_the_image():
    # A long one on the right, from 10 m behind to 10 m ahead: it fills the right of the image.
    boxes = Boxes3D(np.array([[0.27, -3.0, -1.0]]), np.array([[20.0, 2.0, 3.0]]), np.zeros(1))
    x1, y1, x2, y2 = box_outlines_px(CALIBRATION.image_P_velo, boxes, SIZE_PX)[0]
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
    camera = read_benchmark_calibration(folder / "calib/0000.txt").camera
    calibration = replace(camera, image_size_px=SIZE_PX)
    for frame, labels in read_tracking_labels(folder / "label_02/0000.txt", calibration).items():
        count = len(labels)
        tracks = Tracks.unclassified(
            labels.track_ids, labels.boxes_velo, np.zeros((count, 2)), np.ones(count, bool)
        )
        rows = track_rows(frame, tracks, calibration)
        whole = labels.truncation == 0
        assert np.isin(labels.track_ids[whole], rows.ids).all()
        mine = rows.boxes_px[np.isin(rows.ids, labels.track_ids[whole])]
        # Annotators drew the boxes of the image by hand, some of them around what is visible.
        assert np.median(np.abs(mine - labels.boxes_px[whole])) < 8


@pytest.fixture
def vehicles():
    """A car ahead that is followed, and one of which there is nothing but a box in the image."""
    nan = np.nan
    return Vehicles(
        fused=FusedDetections(
            Detections(
                np.array([[500.0, 150, 620.25, 240], [10, 160, 60, 200]]),
                np.array([0.875, 0.25]),
                np.array(["Car", "Car"]),
            ),
            source_indices=np.array([[0, 0, -1], [1, -1, -1]]),
            dominant_modality=np.array([0, 0]),
            existence=np.array([0.875, 0.25]),
        ),
        ids=np.array([7, -1]),
        boxes=Boxes3D(
            np.array([[20.27, 2.0, -1.7], [nan] * 3]),
            np.array([[4.2, 1.8, 1.5], [nan] * 3]),
            np.array([0.0, nan]),
        ),
        distances_m=np.array([18.0, nan]),
        velocities_m_s=np.array([[3.0, 0], [nan, nan]]),
        covariances=np.full((2, 4, 4), nan),
        box_deviations=BoxDeviations.unknown(2),
        owners=np.full(5, -1),
    )


def test_rows_are_what_the_benchmarks_server_takes(vehicles):
    rows = format_object_rows(vehicles, CALIBRATION).splitlines()
    first, second = (row.split() for row in rows)
    assert len(first) == len(second) == 16
    assert (first[:3], second[:3]) == (["Car", "-1", "-1"], ["Car", "-1", "-1"])
    # Seen from behind: heading ry is -90 degrees, alpha the same less the way to where it stands.
    expected = [
        *(np.arctan2(2.0, 20.27) - np.pi / 2, 500, 150, 620.25, 240),
        *(1.5, 1.8, 4.2, -2.0, 1.78, 20.0, -np.pi / 2, 0.875),
    ]
    np.testing.assert_allclose([float(word) for word in first[3:]], expected, atol=1e-6)
    # Without a 3D box, alpha is that of a heading along the camera's.
    assert float(second[3]) == pytest.approx(-np.pi / 2 - np.arctan2(35 - 600, 700), abs=1e-6)
    unknown = [10, 160, 60, 200, -1, -1, -1, -1000, -1000, -1000, -10, 0.25]
    assert [float(word) for word in second[4:]] == unknown


def test_our_own_evaluator_reads_what_was_written(vehicles, tmp_path):
    text = format_object_rows(vehicles, CALIBRATION)
    label = "Car 0.00 0 -1.57 500 150 620.25 240 1.5 1.8 4.2 -2.0 1.78 20.0 -1.57\n"
    for folder, content in (("results/data", text), ("label_2", label)):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "000000.txt").write_text(content)
    read = read_detection_set(tmp_path / "results", tmp_path / "label_2").detections
    np.testing.assert_array_equal(read.boxes_px, vehicles.fused.detections.boxes_px)
    assert read.scores.tolist() == [0.875, 0.25]
    # Of the second vehicle only the rectangle is known: it has the heading of the camera.
    boxes_px = vehicles.fused.detections.boxes_px
    usual = usual_observation_angles_rad(boxes_px, CALIBRATION)
    assert read.alphas_rad[1] == pytest.approx(usual[1], abs=1e-6)
    assert read.boxes_3d.size_m[1].tolist() == [-1, -1, -1]


def test_files_and_memory_are_evaluated_as_the_same_boxes(vehicles, tmp_path):
    for folder in ("results", "label_2"):
        (tmp_path / folder).mkdir()
        text = format_object_rows(vehicles, CALIBRATION)
        (tmp_path / folder / "000000.txt").write_text(text)
    read = read_detection_set(tmp_path / "results", tmp_path / "label_2").detections
    located = LocatedDetections(vehicles.fused.detections, vehicles.boxes, CALIBRATION)
    made = DetectedBoxes.of_located([located])
    np.testing.assert_allclose(made.alphas_rad, read.alphas_rad, atol=1e-6)
    for name, column in vars(made.boxes_3d).items():
        turn = 2 * np.pi if name == "yaw_rad" else np.inf
        apart = np.abs(column - getattr(read.boxes_3d, name))
        assert np.minimum(apart, np.abs(apart - turn)).max() < 2e-6, name
    labels = read_object_labels(tmp_path / "label_2/000000.txt", CALIBRATION)
    truths = TrueBoxes.of_frames([labels], [CALIBRATION])
    np.testing.assert_allclose(truths.boxes_3d.bottom_m[0], read.boxes_3d.bottom_m[0], atol=1e-9)
    assert np.cos(truths.alphas_rad[0] - read.alphas_rad[0]) == pytest.approx(1)


def test_boxes_read_back_in_the_lidar_frame(vehicles, tmp_path):
    path = tmp_path / "000000.txt"
    path.write_text(format_object_rows(vehicles, CALIBRATION))
    read = read_object_labels(path, CALIBRATION).boxes_velo
    np.testing.assert_allclose(read.bottom_m[0], [20.27, 2.0, -1.7], atol=2e-6)
    np.testing.assert_allclose(read.size_m[0], [4.2, 1.8, 1.5], atol=1e-6)
    np.testing.assert_allclose(read.yaw_rad[0], 0.0, atol=1e-6)


def test_only_followed_vehicles_are_rows_of_the_tracking_benchmark(vehicles, tmp_path):
    path = tmp_path / "0000.txt"
    path.write_text(format_result_rows(vehicle_rows(3, vehicles, CALIBRATION)))
    rows = read_result_rows(path, 4)
    assert (rows.frames.tolist(), rows.ids.tolist(), rows.scores.tolist()) == ([3], [7], [0.875])


def test_a_tracked_object_has_a_row_until_it_is_lost():
    box = tracks_at(CAR).boxes
    for status, scores in (("seen", [1.0]), ("predicted", [0.5]), ("lost", [])):
        tracked = TrackedObject(TrackStatus(status), box, np.zeros(2), None)
        rows = trajectory_rows(3, tracked, 8, "Van", CALIBRATION)
        assert rows.scores.tolist() == scores
        assert rows.ids.tolist() == [8] * len(scores)
        assert rows.types.tolist() == ["Van"] * len(scores)


def test_a_tracked_object_in_the_image_alone_has_a_rectangle():
    box_px = np.array([10.0, 20, 30, 40])
    tracked = TrackedObject(TrackStatus.SEEN, None, np.zeros(2), box_px)
    rows = trajectory_rows(3, tracked, 8, None, CALIBRATION)
    np.testing.assert_array_equal(rows.boxes_px, [box_px])
    assert (rows.sizes_hwl_m == -1).all()
    assert len(trajectory_rows(3, replace(tracked, box_px=None), 8, None, CALIBRATION)) == 0
