"""Frames are counted from 0; results are named as the files are, and files are joined by their names."""

import numpy as np
import pytest

from data.frames import file_number, read_frames
from data.open_drive import open_drive
from data.synthetic.drive import SyntheticDrive
from perception.errors import CalibrationError, ImageError
from tests.car_frames import write_car_frames
from tests.faults import fault


def test_object_frames_have_gaps(tmp_path):
    root = write_car_frames(tmp_path / "cars", frames=4, cars=0)
    for file in root.rglob("000001.*"):
        file.unlink()
    drive = open_drive(root)
    assert [file_number(drive, frame.index) for frame in drive] == [0, 2, 3]


def test_sequences_may_begin_late(tmp_path):
    objects = write_car_frames(tmp_path / "cars", frames=2, cars=0) / "training"
    tracking = tmp_path / "tracking/training"
    (tracking / "velodyne/0000").mkdir(parents=True)
    (tracking / "calib").mkdir()
    (objects / "calib/000000.txt").rename(tracking / "calib/0000.txt")
    for number in (0, 1):
        scan = objects / f"velodyne/{number:06d}.bin"
        scan.rename(tracking / f"velodyne/0000/{number + 5:06d}.bin")
    drive = open_drive(tracking)
    assert [file_number(drive, frame.index) for frame in drive] == [5, 6]


def test_a_drive_in_memory_has_no_files():
    assert file_number(SyntheticDrive(3, images=False), 2) == 2


FIRST_NS = 1_700_000_000_123_456_789


def _rename(folder, name_of):
    """Rename the files of a folder; `name_of` gives the new name of each index."""
    for index, path in enumerate(sorted(folder.iterdir())):
        path.rename(folder / f"{name_of(index)}{path.suffix}")


@pytest.fixture
def stamped_drive(raw_drive):
    """Return a raw drive of scans only, named by nanoseconds, the third 0.3 s after the second."""
    _rename(raw_drive / "velodyne_points/data", lambda i: FIRST_NS + (i + 2 * (i > 1)) * 10**8)
    assert open_drive(raw_drive).origin_ns == 1_317_042_272_000_000_000
    (raw_drive / "velodyne_points/timestamps.txt").unlink()
    for part in ("image_02", "oxts"):
        (raw_drive / part).rename(raw_drive.parent / part)
    return raw_drive


def test_names_by_nanoseconds_are_kept_and_tell_the_time(stamped_drive):
    drive = open_drive(stamped_drive)
    assert len(drive) == 6
    frames = list(drive)
    assert [frame.index for frame in frames] == [frame.number for frame in frames] == [*range(6)]
    assert frames[5].name == str(FIRST_NS + 7 * 10**8)
    assert [frame.stamp_s for frame in frames] == pytest.approx([0, 0.1, 0.4, 0.5, 0.6, 0.7])
    assert drive.notes == ()


def test_names_are_sorted_naturally(stamped_drive):
    _rename(stamped_drive / "velodyne_points/data", lambda index: f"scan-{2 * index + 1}")
    drive = open_drive(stamped_drive)
    assert [frame.name for frame in drive] == [f"scan-{number}" for number in (1, 3, 5, 7, 9, 11)]
    assert drive[3].stamp_s == pytest.approx(0.3)


def test_two_spellings_of_one_number_are_two_frames(stamped_drive):
    folder = stamped_drive / "velodyne_points/data"
    _rename(folder, lambda index: f"{index + 1:03d}")
    (folder / "006.bin").rename(folder / "0002.bin")
    assert {frame.name for frame in open_drive(stamped_drive)} == {
        "001", "002", "0002", "003", "004", "005",
    }  # fmt: skip


def test_images_of_other_names_are_joined_in_order(stamped_drive):
    images = stamped_drive / "image_02/data"
    (stamped_drive.parent / "image_02").rename(stamped_drive / "image_02")
    _rename(images, lambda index: f"image-{index}")
    drive = open_drive(stamped_drive)
    assert drive.images.paths[4].stem == "image-4"
    (note,) = drive.notes
    assert note.startswith(f"{images}: 6 images are joined")


def test_images_that_cannot_be_joined_are_noted_and_left_out(stamped_drive):
    (stamped_drive.parent / "image_02").rename(stamped_drive / "image_02")
    (stamped_drive / "image_02/data/0000000005.png").unlink()
    drive = open_drive(stamped_drive)
    assert not drive.has_images
    (note,) = drive.notes
    assert "5 images are not used" in note


def test_a_missing_image_is_that_of_its_scan(raw_drive):
    (raw_drive / "image_02/data/0000000003.png").unlink()
    drive = open_drive(raw_drive)
    with fault(ImageError, where=str(raw_drive / "image_02/data/0000000003.png"), found="no file"):
        drive[3]
    assert drive.notes == ()


def test_labels_without_a_calibration_say_so(tracking_root):
    (tracking_root / "training/calib/0001.txt").unlink()
    (tracking_root / "training/oxts/0001.txt").unlink()
    drive = open_drive(tracking_root, sequence="0001")
    with fault(CalibrationError, expected="to place the labels of", found="none"):
        drive.labels(0)


def test_oddities_are_logged_once(raw_drive, caplog):
    _rename(raw_drive / "image_02/data", lambda index: f"left{index}")
    for index in (2, 4):
        path = raw_drive / f"velodyne_points/data/{index:010d}.bin"
        points = np.fromfile(path, np.float32)
        points[0] = np.nan
        points.tofile(path)
    frames = list(read_frames(open_drive(raw_drive, sensor="VLP-16")))
    assert len(frames) == 6
    said = [record.getMessage() for record in caplog.records]
    assert [[words in one for one in said] for words in ("images", "beams", "points are")] == [
        [True, False, False], [False, True, False], [False, False, True],
    ]  # fmt: skip
