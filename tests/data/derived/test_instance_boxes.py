"""Instances of points become boxes, which train and measure as those of labels do."""

import numpy as np
import pytest

from data.array_store import ArrayStore
from data.labelled_objects import box_owners
from data.open_drive import open_drive
from data.samples.bev.labelled_scans import LabelledScans
from data.synthetic.drive import CachedDrive
from perception.cli.main import main
from perception.detection.bev.bev_map import BevGrid
from perception.errors import DriveError
from perception.geometry.box_overlap import iou_bev
from perception.sensor import load_sensor
from tests.faults import fault
from tests.other_layouts import write_semantic_kitti

FRAMES = 8


@pytest.fixture(scope="module")
def exact():
    return CachedDrive(FRAMES, seed=5, sensor=load_sensor("HDL-32E"))


@pytest.fixture
def sequence(exact, tmp_path):
    return write_semantic_kitti(tmp_path, exact, images=False) / "dataset/sequences/08"


def overlaps(exact, drive, kind):
    """Return BEV IoU of each object of a type with 30 returns, and its sizes beside those of the best box."""
    found, sizes_m = [], []
    for index in range(len(drive)):
        truth, labels = exact.labels_around(index), drive.labels_around(index)
        owners = box_owners(truth.boxes_velo, drive.points_velo(index))
        counts = np.bincount(owners[owners >= 0], minlength=len(truth))
        rows = np.flatnonzero((counts >= 30) & (truth.types == kind))
        iou = iou_bev(truth.boxes_velo[rows], labels.boxes_velo)
        assert (labels.types[iou.argmax(axis=1)] == kind).all()
        found += iou.max(axis=1).tolist()
        sizes_m += labels.boxes_velo.size_m[iou.argmax(axis=1)].tolist()
    return np.array(found), np.array(sizes_m)


def test_boxes_lie_where_the_objects_are(exact, sequence):
    drive = open_drive(sequence)
    assert (drive.has_labels, drive.has_point_truth) == (True, True)
    cars, sizes_m = overlaps(exact, drive, "Car")
    assert len(cars) > 50
    assert (cars > 0.5).mean() > 0.95
    assert np.median(cars) > 0.8
    assert len(np.unique(sizes_m, axis=0)) < len(cars) / 4  # of an object over the drive
    people, _ = overlaps(exact, drive, "Pedestrian")
    assert np.median(people) > 0.7
    # A part of a drive has the boxes of the whole.
    np.testing.assert_array_equal(
        drive.select([3]).labels_around(0).boxes_velo.size_m,
        drive.labels_around(3).boxes_velo.size_m,
    )
    cars_ahead = drive.labels(2)
    assert 0 < len(cars_ahead) < len(drive.labels_around(2))
    assert (cars_ahead.boxes_px[:, 2] > cars_ahead.boxes_px[:, 0]).all()


def test_an_object_keeps_its_id(sequence):
    drive = open_drive(sequence)
    first, last = (drive.labels_around(index) for index in (0, FRAMES - 1))
    kind_of = dict(zip(first.track_ids.tolist(), first.types.tolist(), strict=True))
    both = [(kind_of[key], kind) for key, kind in zip(last.track_ids.tolist(), last.types.tolist(), strict=True) if key in kind_of]  # fmt: skip
    assert len(both) > 10
    assert all(before == after for before, after in both)


def test_without_poses_each_scan_is_on_its_own(exact, sequence):
    (sequence / "poses.txt").unlink()
    drive = open_drive(sequence)
    assert not drive.has_poses
    cars, sizes_m = overlaps(exact, drive, "Car")
    assert np.median(cars) > 0.7
    assert len(np.unique(sizes_m, axis=0)) > len(cars) / 2


def test_they_are_learned_and_evaluated(sequence, capsys):
    drive = open_drive(sequence)
    scan = LabelledScans([drive], BevGrid(), ArrayStore()).scan(0)
    cars = scan.labels.boxes[scan.labels.types == "Car"]
    assert len(cars) > 5
    assert np.abs(np.median(cars[:, 2])) < 0.05  # bottoms on the ground
    assert scan.labels.view_rad.tolist() == pytest.approx([0.0, np.pi])
    words = (
        f"evaluate detection {sequence} --protocol nuscenes --detection.modalities bev --frames 2"
    )
    assert main(words.split()) == 0
    [row] = (one.split() for one in capsys.readouterr().out.splitlines() if one.startswith("car "))
    assert (int(row[1]) > 20, float(row[3]) > 40) == (True, True)


def test_objects_without_numbers_are_no_labels(sequence, capsys):
    for path in (sequence / "labels").iterdir():
        path.write_bytes((np.fromfile(path, np.uint32) & 0xFFFF).tobytes())
    drive = open_drive(sequence)
    assert (drive.has_labels, drive.has_point_truth) == (False, True)
    with fault(
        DriveError, "08", "a drive with labelled boxes", "labels of points without instances"
    ):
        drive.labels(0)
    assert main(["evaluate", "detection", str(sequence), "--protocol", "nuscenes"]) == 2
    assert main(["evaluate", "vehicles", str(sequence)]) == 2
    assert main(["train", "bev", str(sequence), "--steps", "1"]) == 2
    assert "without instances" in capsys.readouterr().err
