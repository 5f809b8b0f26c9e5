"""Logs of Argoverse 2: what is read of them, and one sentence for what cannot be."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pyarrow
import pytest
from pyarrow import feather

from data.argoverse2.annotations import CATEGORIES, category
from data.argoverse2.calibration import AXLE_HEIGHT_M
from data.layouts import OpenConfig
from data.open_drive import open_drive
from data.recorded_drive import RecordedDrive
from perception.errors import (
    CalibrationError,
    DriveError,
    LabelError,
    MissingDependencyError,
    PoseError,
    ScanError,
    UsageError,
)
from tests.faults import fault
from tests.other_layouts import stamp_ns, write_argoverse2, write_table
from tests.tiny_drive import TinyDrive

EXACT = TinyDrive()


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_argoverse2(tmp_path, EXACT)


def change(path: Path, **columns: object) -> None:
    """Replace columns of a table; None removes one."""
    table = feather.read_table(path)
    for name, values in columns.items():
        table = table.drop_columns([name]) if name in table.column_names else table
        if values is not None:
            table = table.append_column(name, pyarrow.array(values))
    path.unlink()
    feather.write_feather(table, str(path))


def write_ground_map(log: Path, height_m: float) -> None:
    """Write a flat map of the ground, of cells of half a metre, whose corner is at -100 m."""
    folder = log / "map"
    folder.mkdir()
    np.save(
        folder / "x_ground_height_surface____PIT.npy", np.full((400, 400), height_m, np.float16)
    )
    fields = {"R": [1.0, 0.0, 0.0, 1.0], "t": [100.0, 100.0], "s": 2.0}
    (folder / "x___img_Sim2_city.json").write_text(json.dumps(fields))


def test_a_log(log):
    drive = open_drive(log)
    assert (drive.name, len(drive)) == (log.name, 2)
    assert drive.frame_names == (str(stamp_ns(0)), str(stamp_ns(1)))
    assert (drive.has_images, drive.has_labels, drive.has_point_truth) == (True, True, True)
    np.testing.assert_array_equal(drive.points_velo(1), EXACT.scan(1).points_velo)
    np.testing.assert_allclose(
        drive.world_SE3_velo(1)[:3, 3] - drive.world_SE3_velo(0)[:3, 3], [0.5, 0, 0]
    )
    labels = drive.labels_around(1)
    assert (labels.types.tolist(), labels.track_ids.tolist()) == (["Car"], [0])
    np.testing.assert_allclose(labels.boxes_velo.bottom_m, [[12.5, 0, -1.5]])
    np.testing.assert_allclose(labels.boxes_velo.size_m, [[4.0, 1.75, 1.5]])


def test_the_sensor_is_measured(log):
    sensor = open_drive(log).sensor
    assert sensor.height_m == pytest.approx(1.5 + AXLE_HEIGHT_M)
    assert open_drive(log, sensor="VLP-16").sensor.name == "VLP-16"


def test_another_camera(log):
    with fault(UsageError, "--camera ring_rear_left", "ring_front_center", "ring_rear_left"):
        open_drive(log, config=OpenConfig(camera="ring_rear_left"))


def test_sweeps_are_deskewed_already(log):
    with fault(UsageError, "--deskew", "not moved to one time", "Argoverse 2", "leave it out"):
        open_drive(log, config=OpenConfig(deskew=True))


def test_a_log_without_images_and_boxes(log):
    shutil.rmtree(log / "sensors/cameras")
    shutil.rmtree(log / "flow_labels")
    (log / "annotations.feather").unlink()
    drive = open_drive(log)
    assert (drive.has_images, drive.has_labels, drive.has_point_truth) == (False, False, False)
    assert drive.point_truth(0) is None
    assert drive.other_labels() == []
    with fault(DriveError, log.name, "annotations.feather", "none"):
        drive.labels(0)


def test_images_that_are_far_in_time_are_not_used(log):
    (image, _) = sorted((log / "sensors/cameras/ring_front_center").iterdir())
    image.rename(image.with_name("1.jpg"))
    drive = open_drive(log)
    assert drive.image(0) is None
    assert drive.image(1).shape == (375, 1242, 3)
    assert "1 of 2 sweeps have no image" in drive.notes[0]
    shutil.rmtree(image.parent)
    image.parent.mkdir()
    assert "no image is near a sweep" in open_drive(log).notes[0]


def test_labels_of_moments_without_a_sweep_tell_what_moves(log):
    (log / f"sensors/lidar/{stamp_ns(1)}.feather").unlink()
    drive = open_drive(log)
    (other,) = drive.other_labels()
    assert (other.frame, other.stamp_s) == (-1, pytest.approx(0.1))
    np.testing.assert_allclose(other.labels.boxes_velo.bottom_m, [[12.5, 0, -1.5]])


def test_truth_without_scene_flow_comes_from_boxes_and_the_map(log):
    shutil.rmtree(log / "flow_labels")
    drive = open_drive(log)
    assert drive.point_truth(0) is None
    write_ground_map(log, height_m=0.0)
    for index in range(2):
        truth, known = open_drive(log).point_truth(index), EXACT.point_truth(index)
        np.testing.assert_array_equal(truth.classes, np.where(known.instances > 0, 10, 49))
        np.testing.assert_array_equal(truth.is_moving, known.is_moving)
        np.testing.assert_array_equal(truth.instances > 0, known.instances > 0)


def test_points_in_a_box_and_near_the_ground_have_no_label(log):
    shutil.rmtree(log / "flow_labels")
    write_ground_map(log, height_m=0.4)  # with what the map calls near, up to 0.7 m
    truth, points = open_drive(log).point_truth(0), EXACT.scan(0).points_velo
    of_car = EXACT.point_truth(0).instances > 0
    np.testing.assert_array_equal(truth.classes[of_car] == 0, points[of_car, 2] + 1.75 <= 0.7)


def test_points_off_the_map_are_no_ground(log):
    shutil.rmtree(log / "flow_labels")
    write_ground_map(log, height_m=np.nan)
    assert set(open_drive(log).point_truth(0).classes.tolist()) == {10, 99}


def test_one_file_of_scene_flow_belongs_to_the_first_sweep(log):
    (log / f"flow_labels/{stamp_ns(0)}.feather").rename(log / "flow_labels.feather")
    shutil.rmtree(log / "flow_labels")
    drive = open_drive(log)
    assert drive.point_truth(1) is None
    np.testing.assert_array_equal(drive.point_truth(0).is_moving, EXACT.point_truth(0).is_moving)


def test_other_names_of_scene_flow(log):
    path = log / f"flow_labels/{stamp_ns(0)}.feather"
    table = feather.read_table(path).rename_columns(["category_indices", "is_dynamic", "is_ground"])
    path.unlink()
    feather.write_feather(table, str(path))
    np.testing.assert_array_equal(
        open_drive(log).point_truth(0).is_moving, EXACT.point_truth(0).is_moving
    )


def test_a_damaged_sweep(log):
    path = log / f"sensors/lidar/{stamp_ns(1)}.feather"
    drive = open_drive(log)
    change(path, intensity=None)
    with fault(ScanError, path.name, "columns x, y, z, intensity, laser_number", "no intensity"):
        drive[1]
    path.write_bytes(path.read_bytes()[:100])
    with fault(ScanError, path.name, "as a feather table", "100 bytes", "copy the file again"):
        drive[1]
    path.unlink()
    with fault(ScanError, path.name, "a sweep", "no file"):
        drive[1]
    # Where it is met, its place stands for its contents.
    assert drive.fingerprint(1) != drive.fingerprint(0)


def test_no_sweep(log):
    shutil.rmtree(log / "sensors/lidar")
    (log / "sensors/lidar").mkdir()
    with fault(DriveError, "sensors/lidar", "sweeps named by nanoseconds", "none"):
        open_drive(log)


@pytest.mark.parametrize(
    ("table", "columns", "kind", "expected", "found"),
    [
        ("city_SE3_egovehicle", {"qw": [0.0, 0], "qx": [0.0, 0], "qy": [0.0, 0], "qz": [0.0, 0]}, PoseError, "quaternions", "length 0"),
        ("city_SE3_egovehicle", {"tx_m": [0.0, np.nan]}, PoseError, "finite numbers", "NaN"),
        ("city_SE3_egovehicle", {"tx_m": [0.0, None]}, PoseError, "a tx_m in every row", "rows without"),
        ("calibration/egovehicle_SE3_sensor", {"sensor_name": ["ring_front_center", "x"]}, CalibrationError, "the place of up_lidar", "ring_front_center, x"),
        ("calibration/intrinsics", {"sensor_name": ["other"]}, CalibrationError, "a row of ring_front_center", "none"),
        ("annotations", {"length_m": [4.0, 0.0]}, LabelError, "boxes with a size", "not above 0"),
    ],
)  # fmt: skip
def test_damaged_tables(log, table, columns, kind, expected, found):
    change(log / f"{table}.feather", **columns)
    with fault(kind, f"{table.split('/')[-1]}.feather", expected, found):
        open_drive(log)


def test_poses_that_are_missing(log):
    path = log / "city_SE3_egovehicle.feather"
    change(path, timestamp_ns=[stamp_ns(0), 5])
    with fault(PoseError, path.name, f"a pose at the sweep of {stamp_ns(1)} ns", "none"):
        open_drive(log)[1]
    table = feather.read_table(path).slice(0, 0)
    path.unlink()
    feather.write_feather(table, str(path))
    with fault(PoseError, path.name, "poses of the vehicle", "none"):
        open_drive(log)


def flow_fault(log: Path, **columns: object) -> RecordedDrive:
    change(log / f"flow_labels/{stamp_ns(0)}.feather", **columns)
    return open_drive(log)


def test_scene_flow_of_another_sweep(log):
    count = len(EXACT.scan(0).points_velo)
    path = log / f"flow_labels/{stamp_ns(0)}.feather"
    write_table(path, {"classes": [0], "dynamic": [False], "is_ground_0": [True]})
    with fault(LabelError, path.name, f"a label for each of {count} points", "1 rows"):
        open_drive(log).point_truth(0)


def test_scene_flow_of_unknown_classes(log):
    count = len(EXACT.scan(0).points_velo)
    drive = flow_fault(log, classes=np.full(count, 31, np.uint8))
    with fault(LabelError, "feather", "classes from 0 to 30", "31 to 31"):
        drive.point_truth(0)


def test_damaged_maps(log):
    write_ground_map(log, height_m=0.0)
    (similarity,) = (log / "map").glob("*.json")
    similarity.write_text('{"R": [1, 0]}')
    with fault(LabelError, similarity.name, "rotation R, translation t and scale s"):
        open_drive(log)
    (heights,) = (log / "map").glob("*.npy")
    np.save(heights, np.zeros(3))
    with fault(LabelError, heights.name, "one table of heights", "something else"):
        open_drive(log)
    heights.write_bytes(b"no array")
    with fault(LabelError, heights.name, "an array of heights"):
        open_drive(log)


def test_without_pyarrow(log, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with fault(MissingDependencyError, "feather", "pyarrow", advice="[tables]"):
        open_drive(log)


def test_categories():
    assert len(CATEGORIES) == 30
    assert (category("REGULAR_VEHICLE").kind, category("BUS").kind) == ("Car", "Truck")
    assert (category("A_NEW_ONE").kind, category("A_NEW_ONE").point_class) == ("Misc", 99)
    assert list(CATEGORIES) == sorted(CATEGORIES)
