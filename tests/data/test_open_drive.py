"""Each layout is recognised, and read as what it is."""

from pathlib import Path

import numpy as np
import pytest

from data.layouts import OpenConfig
from data.open_drive import open_drive, open_drives, sequences_in
from perception.errors import CalibrationError, DriveError, UsageError
from perception.geometry.boxes import points_inside
from perception.geometry.camera import project
from perception.sensor import VLP_16, sensor_to_json
from tests.faults import fault


def test_a_raw_drive_has_scans_images_and_poses(raw_drive):
    drive = open_drive(raw_drive)
    assert (len(drive), drive.name, drive.is_sequence) == (6, raw_drive.name, True)
    assert (drive.has_images, drive.has_poses, drive.has_labels) == (True, True, False)
    frame = drive[3]
    assert frame.index == 3
    assert frame.stamp_s == pytest.approx(0.3)
    assert frame.points_velo.shape == (3600, 4)
    assert frame.image[0, 0].tolist() == [255, 0, 0]  # RGB
    assert frame.source.endswith("0000000003.bin")


def test_a_path_may_be_a_text(raw_drive, tmp_path):
    (tmp_path / "mine.json").write_text(sensor_to_json(VLP_16))
    for sensor in (tmp_path / "mine.json", str(tmp_path / "mine.json")):
        drive = open_drive(str(raw_drive), sensor=sensor)
        assert (drive.root, drive.sensor.name) == (raw_drive, "VLP-16")
    assert sequences_in(str(raw_drive.parent)) == [raw_drive.name]
    assert [one.root for one in open_drives([str(raw_drive)])] == [raw_drive]
    with fault(UsageError, where="sensor none.json", found="'none.json'"):
        open_drive(raw_drive, sensor=Path("none.json"))


def test_the_pose_is_that_of_the_lidar(raw_drive):
    drive = open_drive(raw_drive)
    # The LiDAR sits 0.8 m before, 0.3 m right of and 0.8 m over the IMU, which heads north-east.
    forward, right = np.array([1, 1]) / np.sqrt(2), np.array([1, -1]) / np.sqrt(2)
    expected = np.append(0.8 * forward + 0.3 * right, 0.8)
    np.testing.assert_allclose(drive[0].world_SE3_velo[:3, 3], expected, atol=1e-6)
    step_m = drive[5].world_SE3_velo[:3, 3] - drive[0].world_SE3_velo[:3, 3]
    np.testing.assert_allclose(step_m, [*(5 * forward), 0], atol=1e-5)


def test_a_raw_drive_is_found_by_its_number_in_the_folder_of_the_date(raw_drive):
    assert open_drive(raw_drive.parent, sequence="42").root == raw_drive
    assert sequences_in(raw_drive.parent) == [raw_drive.name]


def test_synthetic_raw_drives_bring_labels_truth_and_their_sensor(raw_drive, tracking_root):
    labels = (tracking_root / "training/label_02/0001.txt").read_text()
    (raw_drive / "label_02.txt").write_text(labels)
    (raw_drive / "sensor.json").write_text(sensor_to_json(VLP_16))
    words = np.full(3600, 40, np.uint32)
    words[:10] = 252 | 8 << 16  # a moving car, object 8
    (raw_drive / "labels").mkdir()
    words.tofile(raw_drive / "labels/0000000002.label")

    drive = open_drive(raw_drive)

    assert drive.sensor.name == "VLP-16"
    assert open_drive(raw_drive, sensor="HDL-32E").sensor.name == "HDL-32E"
    assert drive.labels(2).track_ids.tolist() == [7]
    truth = drive.point_truth(2)
    assert truth.classes[[0, 10]].tolist() == [10, 40]
    assert truth.instances[[0, 10]].tolist() == [8, 0]
    assert truth.is_moving.sum() == 10


def test_a_tracking_sequence_has_labels_too(tracking_root):
    for root in (tracking_root, tracking_root / "training"):
        drive = open_drive(root, sequence="0004")
        assert (drive.name, len(drive), drive.has_labels) == ("0004", 6, True)
    labels = drive.labels(5)
    np.testing.assert_allclose(labels.boxes_velo.bottom_m, [[12, 1, -1.73]], atol=1e-5)
    assert drive.calibration.image_size_px == (62, 19)  # of the first image
    assert drive[2].stamp_s == pytest.approx(0.2)


def test_a_sequence_must_be_named_where_there_are_several(tracking_root):
    with fault(DriveError, found="0001, 0004", advice="choose one with --sequence"):
        open_drive(tracking_root)
    with fault(DriveError, expected="sequence 0009", found="0001, 0004"):
        open_drive(tracking_root, sequence="0009")
    assert sequences_in(tracking_root) == ["0001", "0004"]


def test_object_frames_are_no_sequence(object_root):
    drive = open_drive(object_root)
    assert (len(drive), drive.is_sequence, drive.has_poses) == (2, False, False)
    frame = drive[1]
    assert frame.source.endswith("000003.bin")
    assert frame.world_SE3_velo is None
    assert frame.calibration.image_size_px == (60, 19)
    assert drive.labels(1).types.tolist() == ["Car"]
    with fault(UsageError, expected="none, as the path itself names the drive"):
        open_drive(object_root, sequence="0001")


def test_a_drive_of_scans_alone_is_a_drive(raw_drive):
    for name in ("image_02", "oxts"):
        (raw_drive / name).rename(raw_drive.parent / name)
    (raw_drive / "velodyne_points/timestamps.txt").unlink()
    for file in raw_drive.parent.glob("calib_*.txt"):
        file.unlink()

    drive = open_drive(raw_drive)

    assert not (drive.has_images or drive.has_poses or drive.has_labels)
    assert drive[4].image is drive[4].world_SE3_velo is drive[4].calibration is None
    assert drive[4].stamp_s == pytest.approx(0.4)
    with fault(DriveError, expected="a drive with labels", found="none"):
        drive.labels(0)


def test_the_start_may_be_left_out(raw_drive):
    whole, part = open_drive(raw_drive), open_drive(raw_drive, config=OpenConfig(start=4))
    assert part.frame_names == whole.frame_names[4:]
    frame = part[1]
    assert (frame.index, frame.number, frame.name) == (1, 5, whole[5].name)
    assert frame.stamp_s == whole[5].stamp_s
    np.testing.assert_array_equal(frame.points_velo, whole[5].points_velo)
    step_m = frame.world_SE3_velo[:3, 3] - part[0].world_SE3_velo[:3, 3]
    np.testing.assert_allclose(step_m, [1 / np.sqrt(2), 1 / np.sqrt(2), 0], atol=1e-5)
    with fault(UsageError, "--start", expected="less than 6", found="6"):
        open_drive(raw_drive, config=OpenConfig(start=6))
    with fault(UsageError, "--start", expected="0 or more", found="-1"):
        OpenConfig(start=-1)


def test_a_drive_may_be_thinned(raw_drive):
    whole, part = open_drive(raw_drive), open_drive(raw_drive, config=OpenConfig(start=1, every=2))
    assert part.frame_names == whole.frame_names[1::2]
    assert [part.stamp_s(index) for index in range(3)] == [whole.stamp_s(n) for n in (1, 3, 5)]
    with fault(UsageError, "--every", expected="1 or more", found="0"):
        OpenConfig(every=0)


def test_images_may_be_left_aside(raw_drive):
    drive = open_drive(raw_drive, images=False)
    assert drive[0].image is None
    assert not drive.has_images
    assert drive.calibration.image_size_px == (62, 19)


def test_ins_packets_without_a_calibration_are_refused(raw_drive):
    (raw_drive.parent / "calib_imu_to_velo.txt").unlink()
    with fault(CalibrationError, expected="an IMU-to-LiDAR calibration"):
        open_drive(raw_drive)


def test_a_folder_without_a_drive_is_an_error_that_names_the_layouts(tmp_path):
    with fault(DriveError, expected="a KITTI raw drive", found="an empty folder"):
        open_drive(tmp_path)
    with fault(DriveError, found="no such folder"):
        open_drive(tmp_path / "nowhere")
    (tmp_path / "holiday.jpg").touch()
    with fault(DriveError, expected="a KITTI raw drive", found="holiday.jpg"):
        open_drive(tmp_path)
    with fault(DriveError, expected="a folder", found="a file", advice="name the folder"):
        open_drive(tmp_path / "holiday.jpg")


def test_scans_in_another_format_are_named(tmp_path):
    folder = tmp_path / "velodyne_points" / "data"
    folder.mkdir(parents=True)
    for index in range(8):
        (folder / f"{index}.pcd").touch()
    with fault(DriveError, str(folder), found="8 .pcd files", advice="as a .bin file"):
        open_drive(tmp_path)


@pytest.mark.parametrize("call", ["iterdir", "is_dir"])
def test_a_folder_that_may_not_be_read(tmp_path, monkeypatch, call):
    def refuse(path):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, call, refuse)
    for read in (open_drive, sequences_in):
        with fault(DriveError, str(tmp_path), "that can be read", "Permission denied"):
            read(tmp_path)


def test_the_real_raw_drive(kitti_root):
    drive = open_drive(kitti_root / "raw/2011_09_26", sequence="0005", images=False)
    poses = np.array([drive.world_SE3_velo(index) for index in range(len(drive))])
    steps_m = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    yaw_deg = np.degrees(np.unwrap(np.arctan2(poses[:, 1, 0], poses[:, 0, 0])))
    assert len(drive[0].points_velo) == 123397
    assert steps_m.sum() == pytest.approx(69.4, abs=0.1)
    assert np.ptp(yaw_deg) == pytest.approx(75.3, abs=0.3)
    assert drive[153].stamp_s == pytest.approx(15.7996, abs=1e-4)


def test_the_real_labels_hold_points_and_project_into_their_boxes(kitti_root):
    drive = open_drive(kitti_root / "tracking", sequence="0000", images=False)
    for index in range(0, len(drive), 25):
        frame, labels = drive[index], drive.labels(index)
        near = np.linalg.norm(labels.boxes_velo.bottom_m, axis=1) < 25
        whole = labels[near & (labels.truncation == 0) & (labels.occlusion == 0)]
        inside = points_inside(whole.boxes_velo, frame.points_velo).sum(axis=1)
        assert (inside >= 50).all()
        middle = whole.boxes_velo.bottom_m + whole.boxes_velo.size_m * (0, 0, 0.5)
        pixels, _ = project(frame.calibration.image_P_velo, middle)
        assert ((pixels > whole.boxes_px[:, :2]) & (pixels < whole.boxes_px[:, 2:])).all()
    assert drive.labels(0).types[drive.labels(0).track_ids == 0].tolist() == ["Van"]


def test_real_object_frames_hold_their_labels(kitti_root):
    drive = open_drive(kitti_root / "object", images=False)
    held = []
    for index, frame in enumerate(drive):
        labels = drive.labels(index)
        clear = (labels.occlusion == 0) & (np.linalg.norm(labels.boxes_velo.bottom_m, axis=1) < 30)
        held += points_inside(labels.boxes_velo[clear], frame.points_velo, 0.1).any(axis=1).tolist()
    assert len(drive) == 27
    assert np.mean(held) > 0.98
