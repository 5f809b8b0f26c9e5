"""Scenes of nuScenes: what is read of them, and one sentence for what cannot be."""

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from data.frames import frame_period_s
from data.layouts import OpenConfig
from data.nuscenes import json_tables
from data.nuscenes.boxes import LIDARSEG_NAMES, category
from data.nuscenes.json_tables import read_records
from data.open_drive import open_drive, sequences_in
from data.recorded_drive import RecordedDrive
from perception.errors import DriveError, LabelError, ScanError, UsageError
from tests.faults import fault
from tests.other_layouts import SIZE_PX, write_nuscenes
from tests.tiny_drive import TinyDrive


class ThreeFrames(TinyDrive):
    """Key frame, sweep, key frame."""

    def __len__(self) -> int:
        return 3


EXACT = ThreeFrames()


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return write_nuscenes(tmp_path, EXACT)


def open_it(root: Path, **config: str) -> RecordedDrive:
    return open_drive(root, sequence="scene-0061", config=OpenConfig(**config))


def change(root: Path, table: str, row: int, **fields: object) -> None:
    """Replace fields of a record; None removes one."""
    path = root / f"v1.0-mini/{table}.json"
    records = json.loads(path.read_text())
    records[row] = {name: one for name, one in (records[row] | fields).items() if one is not None}
    path.write_text(json.dumps(records))


def test_a_scene(root):
    drive = open_it(root)
    assert (drive.name, len(drive), drive.frame_numbers) == ("scene-0061", 3, (0, 1, 2))
    assert (drive.has_images, drive.has_labels, drive.has_point_truth) == (True, True, True)
    assert (drive.sensor.beams, drive.sensor.rate_hz, drive.sensor.height_m) == (32, 20.0, 1.5)
    assert drive.calibration.image_size_px == SIZE_PX
    np.testing.assert_array_equal(drive.points_velo(1), EXACT.scan(1).points_velo)
    assert [drive.stamp_s(index) for index in range(3)] == [0.0, 0.1, 0.2]
    assert np.abs(drive.world_SE3_velo(0)[:3, 3]).max() < 3


def test_boxes_between_key_frames_are_on_their_way(root):
    drive = open_it(root)
    for index in range(3):
        labels = drive.labels_around(index)
        np.testing.assert_allclose(
            labels.boxes_velo.bottom_m, [[12 + 0.5 * index, 0, -1.5]], atol=1e-9
        )
        np.testing.assert_allclose(labels.boxes_velo.size_m, [[4.0, 1.75, 1.5]])
        assert (labels.types.tolist(), labels.track_ids.tolist()) == (["Car"], [0])


def test_points_of_a_key_frame(root):
    drive = open_it(root)
    truth, known = drive.point_truth(2), EXACT.point_truth(2)
    np.testing.assert_array_equal(truth.classes, known.classes)
    np.testing.assert_array_equal(truth.is_moving, known.is_moving)
    np.testing.assert_array_equal(truth.instances, np.where(known.instances > 0, 1, 0))
    assert drive.point_truth(1) is None


def test_points_of_a_vehicle_without_a_box_have_no_label(root):
    (root / "v1.0-mini/sample_annotation.json").unlink()
    drive = open_it(root)
    assert (drive.has_labels, drive.other_labels()) == (False, [])
    with fault(DriveError, str(root), "a drive with labelled boxes", "labels of points"):
        drive.labels(0)


def test_images_that_are_missing(root):
    (root / "samples/CAM_FRONT/image_1.jpg").unlink()
    drive = open_it(root)
    # The next one is 88 ms away.
    assert [drive.image(index) is None for index in range(3)] == [False, True, False]
    for path in (root / "samples/CAM_FRONT").iterdir():
        path.unlink()
    assert not open_it(root).has_images


def test_another_camera(root):
    with fault(UsageError, "--camera CAM_BACK", "one of CAM_FRONT", "CAM_BACK"):
        open_it(root, camera="CAM_BACK")


def test_a_cut_to_the_lidar_has_no_camera(root):
    for table in ("sensor", "calibrated_sensor", "sample_data"):
        path = root / f"v1.0-mini/{table}.json"
        kept = [one for one in json.loads(path.read_text()) if "-cam" not in json.dumps(one)]
        path.write_text(json.dumps(kept))
    drive = open_it(root)
    assert (len(drive), drive.has_images, drive.calibration) == (3, False, None)
    assert drive.labels(0).types.tolist() == ["Car"]


def test_tables_that_a_cut_leaves_out(root):
    (root / "v1.0-mini/attribute.json").unlink()
    drive = open_it(root)
    assert (drive.labels_around(0).types.tolist(), drive.notes) == (["Car"], ())
    (root / "v1.0-mini/instance.json").write_text("[]")
    drive = open_it(root)
    assert drive.labels_around(0).types.tolist() == ["Misc"]
    assert "2 of 2 boxes have no category" in drive.notes[0]


def test_the_period_is_that_of_the_frames_and_not_of_the_lidar(root):
    drive = open_it(root)
    assert (1 / drive.sensor.rate_hz, frame_period_s(drive)) == (0.05, 0.1)
    assert frame_period_s(drive.select([0, 2])) == 0.2
    assert frame_period_s(drive.select([0])) == 0.05


def test_a_scene_without_scans(root):
    assert sequences_in(root) == ["scene-0061", "scene-0103"]
    with fault(DriveError, "sample_data.json", "scans of scene-0103", "none"):
        open_drive(root, sequence="scene-0103")


@pytest.mark.parametrize(
    ("table", "row", "fields", "expected", "found"),
    [
        ("ego_pose", 0, {"rotation": [0, 0, 0, 0]}, "a unit quaternion", "[0, 0, 0, 0]"),
        ("ego_pose", 0, {"translation": [0, 0]}, "3 finite numbers as translation", "[0, 0]"),
        ("ego_pose", 0, {"translation": "x"}, "3 finite numbers", "x"),
        ("ego_pose", 0, {"translation": [10**400, 0, 0]}, "3 finite numbers", "[1000"),
        ("ego_pose", 0, {"token": "another"}, "the pose p-d-0", "none"),
        ("sample", 1, {"timestamp": None}, "records with token", "without timestamp"),
        ("sample_annotation", 0, {"size": [1.0]}, "3 finite numbers as size", "[1.0]"),
    ],
)  # fmt: skip
def test_damaged_records(root, table, row, fields, expected, found):
    change(root, table, row, **fields)
    with fault(DriveError, f"{table}.json", expected, found):
        open_it(root)


def test_a_damaged_scan(root):
    path = root / "samples/LIDAR_TOP/scan_0.pcd.bin"
    path.write_bytes(path.read_bytes()[:-3])
    with fault(ScanError, path.name, "20 bytes a point", "17 too many"):
        open_it(root)[0]


def test_damaged_point_labels(root):
    path = root / "lidarseg/v1.0-mini/d-0_lidarseg.bin"
    labels = bytearray(path.read_bytes())
    labels[0] = 200
    path.write_bytes(bytes(labels))
    with fault(LabelError, path.name, "numbers of 32 categories", "200, which has none"):
        open_it(root).point_truth(0)
    path.write_bytes(b"12")
    with fault(LabelError, path.name, "a label for each of", "2 bytes"):
        open_it(root).point_truth(0)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("{}", "another text than an array"),
        ('[{"a": 1}, {"a"', "ends within a record"),
        ("", "another"),
    ],
)
def test_texts_that_are_no_tables(tmp_path, text, found):
    path = tmp_path / "scene.json"
    path.write_text(text)
    with fault(DriveError, path.name, "a JSON array", found, "copy the file again"):
        read_records(path, ("a",))


def test_a_table_that_is_missing(tmp_path):
    with fault(DriveError, "scene.json", "a table of nuScenes", "no file"):
        read_records(tmp_path / "scene.json", ())


def test_a_table_is_read_piece_by_piece(tmp_path, monkeypatch):
    monkeypatch.setattr(json_tables, "_PIECE_BYTES", 1 << 10)
    path = tmp_path / "sample_data.json"
    path.write_text(
        json.dumps([{"a": number, "b": "x" * 50} for number in range(20_000)], indent=0)
    )
    tracemalloc.start()
    kept = read_records(path, ("a",), lambda one: one["a"] % 10_000 == 9)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert [one["a"] for one in kept] == [9, 10_009]
    assert peak < 100_000 < path.stat().st_size / 10


def test_categories():
    assert len(LIDARSEG_NAMES) == 32
    kinds = {name: category(name).kind for name in LIDARSEG_NAMES}
    assert (kinds["vehicle.car"], kinds["vehicle.bus.bendy"], kinds["vehicle.ego"]) == (
        "Car",
        "Truck",
        None,
    )
    assert kinds["human.pedestrian.police_officer"] == "Pedestrian"
    assert category("vehicle.bicycle", ("cycle.with_rider",)).kind == "Cyclist"
    assert category("vehicle.bicycle").kind == "Misc"
    assert (category("flat.terrain").point_class, category("new").point_class) == (72, 99)
