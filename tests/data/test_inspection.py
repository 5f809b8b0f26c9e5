"""`inspect_drive` finds all that is wrong, and nothing in what is right."""

import numpy as np
import pytest

from data.inspection import inspect_drive
from data.kitti.sequence import KittiSequence
from data.open_drive import open_drive
from perception.geometry.se3 import from_euler
from tests.damaged_scans import DAMAGES, REFUSED, road_scan


def _findings(root, sequence=None):
    report = inspect_drive(open_drive(root, sequence=sequence))
    return {finding.what: finding for finding in report.findings}


def _replace_number(path, field, change):
    words = path.read_text().split()
    words[field] = f"{float(words[field]) + change:.12f}"
    path.write_text(" ".join(words))


def test_a_whole_drive_is_described_and_has_no_faults(raw_drive):
    report = inspect_drive(open_drive(raw_drive))
    assert report.faults == 0
    assert report.summary.frames == 6
    assert report.summary.seconds == pytest.approx(0.5)
    assert report.summary.distance_m == pytest.approx(5.0, abs=1e-4)
    assert report.summary.parts == ("images", "INS")
    # Its frames are one black frame, six times.
    found = [finding.what for finding in report.findings]
    assert found == ["camera dark", "scan repeated", "no labels"]


def test_all_faults_are_found_in_one_reading(raw_drive):
    (raw_drive / "velodyne_points/data/0000000002.bin").unlink()
    (raw_drive / "velodyne_points/data/0000000003.bin").write_bytes(b"123")
    (raw_drive / "image_02/data/0000000001.png").write_bytes(b"123")
    (raw_drive / "oxts/data/0000000004.txt").unlink()

    found = _findings(raw_drive)

    assert found["scans missing or damaged"].count == 1
    assert found["gaps in the numbering"].first_example.endswith("found 0000000003.bin")
    assert not found["gaps in the numbering"].is_fault
    assert found["images missing, damaged or of another size"].count == 1
    assert found["INS packets missing or malformed"].count == 1


@pytest.mark.parametrize("layout", ["raw", "object"])
def test_images_without_a_calibration_are_noted(raw_drive, object_root, layout):
    for file in (*raw_drive.parent.glob("calib_*cam*.txt"), *object_root.rglob("calib/*.txt")):
        file.unlink()
    (object_root / "training/calib").rmdir()
    found = _findings({"raw": raw_drive, "object": object_root}[layout])
    assert not found["images without calibration"].is_fault


def test_points_without_a_return_are_counted(raw_drive):
    for index, rows in ((1, [0, 8]), (4, [7])):
        path = raw_drive / f"velodyne_points/data/{index:010d}.bin"
        points = np.fromfile(path, np.float32).reshape(-1, 4)
        points[rows, 2] = np.inf
        points.tofile(path)
    note = _findings(raw_drive)["points without a return"]
    assert (note.count, note.is_fault) == (3, False)
    assert "0000000001.bin: 2 of 3600 points" in note.first_example


@pytest.mark.parametrize(("pitch_deg", "is_noted"), [(1.0, False), (5.0, True)])
def test_a_tilted_lidar_is_noted(raw_drive, pitch_deg, is_noted):
    for path in (raw_drive / "velodyne_points/data").iterdir():
        points = road_scan()
        points[:, :3] @= from_euler(0, np.radians(pitch_deg), 0)[:3, :3].astype(np.float32)
        points.tofile(path)
    found = _findings(raw_drive)
    assert ("LiDAR tilted" in found) == is_noted
    if is_noted:
        note = found["LiDAR tilted"]
        assert not note.is_fault
        assert "found roll 0.0, pitch 5.0 degrees against the road" in note.first_example


def test_a_drive_without_reflectance_is_noted(raw_drive):
    for path in (raw_drive / "velodyne_points/data").iterdir():
        points = np.fromfile(path, np.float32).reshape(-1, 4)
        points[:, 3] = 0
        points.tofile(path)
    note = _findings(raw_drive)["no reflectance"]
    assert not note.is_fault
    assert note.first_example.endswith(": all are 0; the reflectance map shows nothing")


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_scan_ends_no_check(raw_drive, damage):
    with np.errstate(invalid="ignore"):
        points = DAMAGES[damage](road_scan())
    points.tofile(raw_drive / "velodyne_points/data/0000000000.bin")
    found = _findings(raw_drive)
    assert ("scans missing or damaged" in found) == (damage in REFUSED)


def test_a_fault_of_the_whole_drive_counts_once(tracking_root):
    for folder in ("calib", "oxts"):
        (tracking_root / f"training/{folder}/0001.txt").unlink()
    fault = _findings(tracking_root, "0001")["unusable calibration"]
    assert (fault.count, fault.is_fault) == (1, True)
    assert "label_02/0001.txt" in fault.first_example


def test_an_ins_jump_of_metres(raw_drive):
    for index in range(3, 6):  # two metres to the north
        _replace_number(raw_drive / f"oxts/data/{index:010d}.txt", 0, 2 / 111_194)
    jump = _findings(raw_drive)["INS jumps"]
    assert jump.count == 1
    assert jump.first_example.startswith("frame 3: expected 1.00 m moved as its velocity says")
    assert "2.00 m off" in jump.first_example


def test_a_leap_of_the_heading(raw_drive):
    _replace_number(raw_drive / "oxts/data/0000000005.txt", 5, 1.5)
    found = _findings(raw_drive)
    assert found["INS turning implausible"].first_example == (
        "frame 5: expected at most 3 rad/s, found 15.0"
    )


def test_a_gap_in_time(raw_drive):
    path = raw_drive / "velodyne_points/timestamps.txt"
    path.write_text(path.read_text().replace("32.5", "33.5"))
    gap = _findings(raw_drive)["gaps in time"]
    expected = "frame 5: expected 0.100 s after the frame before, found 1.100 s"
    assert gap.first_example == expected


@pytest.mark.parametrize(
    ("velo_SE3_else", "sentence"),
    [
        (from_euler(np.pi, 0, 0), "upside down"),
        (from_euler(np.pi / 2, 0, 0), "found +y pointing up"),
        (from_euler(0, -np.pi / 2, 0), "found +x pointing up"),
    ],
    ids=["upside down", "y up", "x up"],
)
def test_a_lidar_mounted_otherwise(raw_drive, velo_SE3_else, sentence):
    path = raw_drive / "velodyne_points/data/0000000000.bin"
    points = np.fromfile(path, np.float32).reshape(-1, 4)
    points[:, :3] = points[:, :3] @ velo_SE3_else[:3, :3]
    points.tofile(path)
    found = _findings(raw_drive)["LiDAR mounting that contradicts its axes or its model"]
    assert found.first_example.startswith(f"{path}: expected")
    assert sentence in found.first_example


def test_a_calibration_that_does_not_fit(raw_drive):
    path = raw_drive.parent / "calib_velo_to_cam.txt"
    path.write_text("R: 0 1 0 0 0 -1 -1.01 0 0\nT: 0 0 0\n")  # looks back, and stretches
    found = _findings(raw_drive)
    assert "invalid rotations" in found
    assert (
        "found 0.0%"
        in found["LiDAR and camera calibration that contradict each other"].first_example
    )


def test_labels_out_of_place(tracking_root):
    path = tracking_root / "training/label_02/0004.txt"
    path.write_text(path.read_text().replace("40.0", "90.0"))
    found = _findings(tracking_root, "0004")
    assert found["label boxes outside the image"].count == 6
    assert "62, 19" in found["label boxes outside the image"].first_example


def test_object_frames_are_checked_one_by_one(object_root):
    assert _findings(object_root) == {}
    path = object_root / "training/velodyne/000003.bin"
    (np.fromfile(path, np.float32).reshape(-1, 4) * (1, -1, -1, 1)).astype(np.float32).tofile(path)
    assert (
        "000003.bin"
        in _findings(object_root)[
            "LiDAR mounting that contradicts its axes or its model"
        ].first_example
    )


def test_poses_without_packets_are_checked_too(raw_drive, monkeypatch):
    monkeypatch.setattr(KittiSequence, "ins_packet", lambda drive, index: None)
    monkeypatch.setattr(
        KittiSequence,
        "world_SE3_velo",
        lambda drive, index: from_euler(
            0, 0, 0.5 * (index > 3), np.array([20.0 * (index > 1), 0, 0])
        ),
    )
    found = _findings(raw_drive)
    assert found["speed between poses implausible"].first_example == (
        "frame 2: expected at most 70 m/s, found 200.0"
    )
    assert found["turning between poses implausible"].first_example == (
        "frame 4: expected at most 3 rad/s, found 5.0"
    )


def test_a_camera_that_faces_back_may_be_known(raw_drive, monkeypatch):
    path = raw_drive.parent / "calib_velo_to_cam.txt"
    path.write_text("R: 0 1 0 0 0 -1 -1 0 0\nT: 0 0 0\n")
    what = "LiDAR and camera calibration that contradict each other"
    assert what in _findings(raw_drive)
    monkeypatch.setattr(KittiSequence, "has_forward_camera", False)
    assert what not in _findings(raw_drive)
