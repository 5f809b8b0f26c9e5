"""Whatever is wrong with a file: a sentence that names it, what was expected, and what was found."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from data.layouts import OpenConfig
from data.open_drive import open_drive
from perception.errors import CalibrationError, DriveError, ImageError, PoseError, ScanError
from tests.faults import fault


def _scan_path(drive, index=2):
    return drive / f"velodyne_points/data/{index:010d}.bin"


def _sentence(drive, error_type, index=2) -> str:
    with pytest.raises(error_type) as error:
        open_drive(drive)[index]
    return str(error.value)


def test_a_truncated_scan(raw_drive):
    path = _scan_path(raw_drive)
    path.write_bytes(path.read_bytes()[:-3])
    sentence = _sentence(raw_drive, ScanError)
    assert sentence.startswith(f"{path}: expected 16 bytes a point")
    assert "found 57597 bytes" in sentence


def test_a_scan_of_three_columns_has_the_wrong_size(raw_drive):
    path = _scan_path(raw_drive)
    np.zeros((7, 3), np.float32).tofile(path)
    assert f"{path}: expected 16 bytes a point" in _sentence(raw_drive, ScanError)


@pytest.mark.parametrize(
    ("points", "found"), [(0, "an empty scan"), (7, "7 points, all of them zero")]
)
def test_a_scan_without_a_return(raw_drive, points, found):
    path = _scan_path(raw_drive)
    np.zeros((points, 4), np.float32).tofile(path)
    with fault(ScanError, where=str(path), expected="at least one return", found=found):
        open_drive(raw_drive)[2]


@pytest.mark.parametrize("value", [np.nan, -np.inf, 1e30], ids=["NaN", "infinity", "huge"])
def test_points_that_are_no_measurement_keep_their_rows(raw_drive, value):
    path = _scan_path(raw_drive)
    points = np.fromfile(path, np.float32).reshape(-1, 4)
    expected = points.copy()
    for row, column in ((1, 0), (20, 2), (20, 3)):
        points[row, column] = value
    points.tofile(path)
    expected[[1, 20]] = 0
    frame = open_drive(raw_drive)[2]
    np.testing.assert_array_equal(frame.points_velo, expected)
    assert frame.invalid_points == 2
    assert replace(frame, stamp_s=1.0).invalid_points == 2


def test_a_scan_that_is_mostly_not_finite_is_refused(raw_drive):
    path = _scan_path(raw_drive)
    points = np.fromfile(path, np.float32).reshape(-1, 4)
    points[:1800, 1] = np.nan
    points.tofile(path)
    assert open_drive(raw_drive)[2].invalid_points == 1800
    points[1800, 1] = np.nan
    points.tofile(path)
    with fault(ScanError, where=str(path), expected="finite", found="1801 of 3600 points"):
        open_drive(raw_drive)[2]
    points[:, :3], points[:, 3] = 1, 65535
    points.tofile(path)
    with fault(ScanError, found="above 10,000", advice="--reflectance-scale 65535"):
        open_drive(raw_drive, config=OpenConfig(reflectance_scale=1))[2]


@pytest.mark.parametrize("value", [-0.1, 255])
def test_reflectance_of_another_scale(raw_drive, value):
    path = _scan_path(raw_drive)
    points = np.fromfile(path, np.float32)
    points[3] = value
    points.tofile(path)
    sentence = _sentence(raw_drive, ScanError)
    assert sentence.startswith(f"{path}: expected reflectance from 0 to 1, found")
    assert f"{value:g}" in sentence


def test_frames_are_those_with_a_scan(raw_drive):
    _scan_path(raw_drive).unlink()
    drive = open_drive(raw_drive)
    assert [(f.index, f.number, f.name) for f in drive][1:3] == [(1, 1, "000001"), (2, 3, "000003")]
    assert [frame.stamp_s for frame in drive][1:3] == pytest.approx([0.1, 0.3])
    (raw_drive / "velodyne_points/timestamps.txt").unlink()
    assert open_drive(raw_drive)[2].stamp_s == pytest.approx(0.3)


def test_a_scan_that_vanishes_while_the_drive_is_read(raw_drive):
    drive, path = open_drive(raw_drive), _scan_path(raw_drive)
    path.unlink()
    with fault(ScanError, str(path), "a scan", "no file", "--on-bad-frame skip"):
        drive[2]


def test_timestamps_for_the_scans_that_are_there(raw_drive):
    _scan_path(raw_drive).unlink()
    path = raw_drive / "velodyne_points/timestamps.txt"
    rows = path.read_text().splitlines()
    path.write_text("\n".join(rows[:2] + rows[3:]))
    assert open_drive(raw_drive)[3].stamp_s == pytest.approx(0.4)


def test_a_timestamp_that_is_none(raw_drive):
    path = raw_drive / "velodyne_points/timestamps.txt"
    path.write_text(path.read_text().replace("32.2", "noon"))
    assert f"{path} row 3: expected a time such as" in _sentence(raw_drive, DriveError)


@pytest.mark.parametrize("damage", [b"", b"\x89PNG not really", None], ids=["empty", "no", "cut"])
def test_an_unreadable_image(raw_drive, damage):
    path = raw_drive / "image_02/data/0000000002.png"
    path.write_bytes(path.read_bytes()[:-20] if damage is None else damage)
    sentence = _sentence(raw_drive, ImageError)
    assert sentence.startswith(f"{path}: expected a whole PNG or JPEG image, found")


def test_an_image_cut_off_is_refused_as_jpeg_too(raw_drive):
    path = raw_drive / "image_02/data/0000000002.png"
    noise = np.random.default_rng(0).integers(0, 255, (19, 62, 3)).astype(np.uint8)
    data = cv2.imencode(".jpg", noise)[1].tobytes()
    path.write_bytes(data)
    assert open_drive(raw_drive)[2].image.shape == (19, 62, 3)
    path.write_bytes(data[: len(data) // 2])
    assert "expected a whole PNG or JPEG image" in _sentence(raw_drive, ImageError)


def test_an_image_of_another_size_than_its_calibration(raw_drive):
    path = raw_drive / "image_02/data/0000000002.png"
    cv2.imwrite(str(path), np.zeros((20, 62, 3), np.uint8))
    calibration = raw_drive.parent / "calib_cam_to_cam.txt"
    sentence = _sentence(raw_drive, ImageError)
    assert sentence == f"{path}: expected 62x19 pixels as {calibration} says, found 62x20"


def test_an_image_of_another_size_than_the_first(tracking_root):
    path = tracking_root / "training/image_02/0001/000002.png"
    cv2.imwrite(str(path), np.zeros((19, 70, 3), np.uint8))
    with fault(ImageError, where="000002.png", expected="62x19 pixels as", found="70x19"):
        open_drive(tracking_root, sequence="0001")[2]


def test_a_missing_calibration_key(raw_drive):
    path = raw_drive.parent / "calib_velo_to_cam.txt"
    path.write_text(path.read_text().replace("T:", "S:"))
    assert _sentence(raw_drive, CalibrationError) == f"{path}: expected the key T, found only R, S"


def test_a_singular_matrix(raw_drive):
    path = raw_drive.parent / "calib_velo_to_cam.txt"
    path.write_text(f"R: {'0 ' * 9}\nT: 0 0 0\n")
    sentence = _sentence(raw_drive, CalibrationError)
    assert sentence == f"{path}: expected an invertible R, found a singular matrix"


def test_a_missing_ins_file(raw_drive):
    path = raw_drive / "oxts/data/0000000002.txt"
    path.unlink()
    sentence = _sentence(raw_drive, PoseError)
    assert sentence.startswith(f"{path}: expected the INS packet of frame 2, found no file")


def test_a_missing_ins_row(tracking_root):
    path = tracking_root / "training/oxts/0001.txt"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([*rows[:2], "", *rows[3:5]]))
    drive = open_drive(tracking_root, sequence="0001")
    with pytest.raises(PoseError) as error:
        drive[2]
    where = f"{path} row 3: expected the INS packet of frame 2, found an empty row"
    assert str(error.value).startswith(where)
    with fault(PoseError, where="row 6", found="only 5 rows"):
        drive[5]


def test_the_first_ins_row_may_be_missing_too(tracking_root):
    path = tracking_root / "training/oxts/0001.txt"
    path.write_text("\n" + path.read_text().split("\n", 1)[1])
    drive = open_drive(tracking_root, sequence="0001")
    np.testing.assert_allclose(drive.world_SE3_velo(1)[2, 3], 0.8, atol=1e-6)
