"""Frames are counted from 0, their files are not."""

from data.frames import file_number
from data.open_drive import open_drive
from data.synthetic.drive import SyntheticDrive
from tests.car_frames import write_car_frames


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
