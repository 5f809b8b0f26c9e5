"""Sequences of SemanticKITTI: one sentence for what cannot be read."""

from pathlib import Path

import numpy as np
import pytest

from data.open_drive import open_drive
from perception.errors import CalibrationError, DriveError, LabelError, PoseError
from tests.faults import fault
from tests.other_layouts import write_semantic_kitti
from tests.tiny_drive import TinyDrive

EXACT = TinyDrive()


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    return write_semantic_kitti(tmp_path, EXACT) / "dataset/sequences/08"


def test_a_sequence(sequence):
    drive = open_drive(sequence)
    assert (drive.name, len(drive), drive.frame_names) == ("08", 2, ("000000", "000001"))
    assert (drive.has_images, drive.has_labels, drive.has_point_truth) == (True, True, True)
    np.testing.assert_allclose(
        drive.world_SE3_velo(1)[:3, 3] - drive.world_SE3_velo(0)[:3, 3], [0.5, 0, 0], atol=1e-9
    )
    np.testing.assert_array_equal(drive.point_truth(1).classes, EXACT.point_truth(1).classes)
    [car] = drive.labels(1).boxes_velo.bottom_m  # the rear of which is 10.75 m ahead
    np.testing.assert_allclose(car, [10.75 + 3.88 / 2, 0, -1.75], atol=0.25)


def test_moving_classes_and_objects_of_two_classes(sequence):
    words = np.zeros(len(EXACT.scan(0).points_velo), np.uint32)
    words[:4] = [252 | 1 << 16, 10 | 1 << 16, 254 | 1 << 16, 40]
    (sequence / "labels/000000.label").write_bytes(words.tobytes())
    truth = open_drive(sequence).point_truth(0)
    assert truth.classes[:4].tolist() == [10, 10, 30, 40]
    assert truth.is_moving[:4].tolist() == [True, False, True, False]
    car, same_car, person, road = truth.instances[:4].tolist()
    assert car == same_car != person
    assert road == 0 < person


def test_scans_alone_beside_a_calibration(sequence):
    for name in ("poses.txt", "times.txt"):
        (sequence / name).unlink()
    for label in (sequence / "labels").iterdir():
        label.unlink()
    drive = open_drive(sequence, images=False)
    assert (drive.has_poses, drive.has_point_truth, drive.world_SE3_velo(0)) == (False, False, None)
    assert drive.stamp_s(1) == pytest.approx(0.1)


def test_poses_of_the_odometry_benchmark(sequence):
    folder = sequence.parents[1] / "poses"
    folder.mkdir()
    expected = open_drive(sequence).world_SE3_velo(1)
    (sequence / "poses.txt").rename(folder / "08.txt")
    np.testing.assert_array_equal(open_drive(sequence).world_SE3_velo(1), expected)


def test_poses_need_the_calibration(sequence):
    (sequence / "calib.txt").unlink()
    drive = open_drive(sequence)
    assert (drive.calibration, drive.has_poses) == (None, False)


def test_a_pose_that_is_missing(sequence):
    rows = (sequence / "poses.txt").read_text().splitlines()
    (sequence / "poses.txt").write_text(rows[0])
    with fault(PoseError, "poses.txt", "a row for frame 1", "1 rows"):
        open_drive(sequence)[1]


@pytest.mark.parametrize(
    ("name", "text", "kind", "expected", "found"),
    [
        ("poses.txt", "1 2 3", PoseError, "12 numbers", "3 words"),
        ("poses.txt", " ".join(["x"] * 12), PoseError, "12 numbers a row", "could not convert"),
        ("poses.txt", " ".join(["nan"] * 12), PoseError, "12 finite numbers", "NaN"),
        ("times.txt", "soon", DriveError, "1 numbers a row", "could not convert"),
        ("calib.txt", "P2: 1 2", CalibrationError, "12 finite numbers after P2", "2"),
        ("calib.txt", "P2: " + "1 0 0 0 0 1 0 0 0 0 1 0", CalibrationError, "the key Tr", "only P2"),
    ],
)  # fmt: skip
def test_damaged_texts(sequence, name, text, kind, expected, found):
    (sequence / name).write_text(text)
    with fault(kind, name, expected, found):
        open_drive(sequence)


def test_a_time_that_is_missing(sequence):
    (sequence / "times.txt").write_text("0.0\n")
    with fault(DriveError, "times.txt row 2", "a time"):
        open_drive(sequence)[1]


def test_labels_of_other_classes(sequence):
    words = np.full(len(EXACT.scan(0).points_velo), 7, np.uint32)
    (sequence / "labels/000000.label").write_bytes(words.tobytes())
    with fault(LabelError, "000000.label", "classes of SemanticKITTI", "7"):
        open_drive(sequence).point_truth(0)


def test_labels_of_another_scan(sequence):
    (sequence / "labels/000001.label").write_bytes(b"1234")
    with fault(LabelError, "000001.label", "a label for each of", "4 bytes"):
        open_drive(sequence).point_truth(1)
