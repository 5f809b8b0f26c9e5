"""Split files and lists of frames: what they hold, where they are refused, and the drives that they choose."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from data.kitti.objects import ObjectFrames
from data.open_drive import open_drive, open_drives
from data.splits.draw import draw_split
from data.splits.files import read_split, split_by_lists, write_split
from data.splits.frame_split import FrameSplit
from perception.errors import DriveError, LabelError, UsageError
from tests.car_frames import write_car_frames
from tests.faults import fault

MakeDrive = Callable[..., ObjectFrames]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_car_frames(tmp_path / "cars", frames=10)


@pytest.fixture
def file(folder: Path, tmp_path: Path) -> Path:
    file = tmp_path / "splits" / "split.json"
    write_split(file, draw_split(open_drives([folder]), (60, 20, 20), by="frames", seed=0))
    return file


def names(drives: list) -> list[str]:
    return [name for drive in drives for name in drive.scans.names]


def test_a_written_split_is_read_back(folder: Path, file: Path):
    drawn = draw_split(open_drives([folder]), (60, 20, 20), by="frames", seed=0)
    split = read_split(file)
    assert split.fingerprint == drawn.fingerprint
    assert (split.by, split.shares, split.seed) == ("frames", (60, 20, 20), 0)
    document = json.loads(file.read_text())
    assert document["drives"][0]["root"] == "../cars/training"
    assert len(document["drives"][0]["train"]) == 6


def test_parts_of_a_drive_are_drives(folder: Path, file: Path):
    split, whole = read_split(file), open_drive(folder)
    parts = {part: split.require_part(split.open(), part) for part in ("train", "val", "test")}
    assert [len(names(drives)) for drives in parts.values()] == [6, 2, 2]
    assert sorted(name for part in parts.values() for name in names(part)) == list(
        whole.scans.names
    )
    (test,) = parts["test"]
    for index, frame in enumerate(test):
        assert frame.index == index
        original = whole[frame.number]
        np.testing.assert_array_equal(frame.points_velo, original.points_velo)
        np.testing.assert_array_equal(
            test.labels(index).boxes_px, whole.labels(frame.number).boxes_px
        )


def test_a_split_goes_with_a_copy_of_the_data(folder: Path, file: Path, tmp_path: Path):
    copy = tmp_path / "elsewhere"
    shutil.move(folder, copy)
    split = read_split(file)
    (drive,) = split.open([copy])
    assert len(split.select([drive], "train", "test")[0]) == 8
    with fault(DriveError, str(folder)):
        split.open()


def test_a_foreign_drive_and_missing_frames_are_refused(folder: Path, file: Path, make_drive):
    split = read_split(file)
    with fault(UsageError, str(file), "a split of 0007 in", "one of training"):
        split.require_part([make_drive(3, "0007")], "val")
    lost = split.drives[0].frames["val"][1]
    (folder / "training" / "velodyne" / f"{lost}.bin").unlink()
    with fault(DriveError, "training", "2 frames that", f"1 of them missing, {lost}"):
        split.require_part(split.open(), "val")


def test_a_part_without_frames_is_refused(make_drive: MakeDrive):
    drive = make_drive(10)
    split = draw_split([drive], (80, 20), by="frames", seed=0)
    assert split.select([drive], "test") == []
    with fault(UsageError, "--part test", found="none; it has train, val"):
        split.require_part([drive], "test")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('{"format": "trifuse spl', "no whole JSON document"),
        ("[1, 2]", "another JSON document"),
        ('{"results": {}}', "another JSON document"),
        ('{"format": "trifuse split 9"}', "format trifuse split 9"),
        ('{"format": "trifuse split 1", "drives": 3}', "other entries"),
    ],
)
def test_another_document_is_refused(tmp_path: Path, text: str, found: str):
    file = tmp_path / "split.json"
    file.write_text(text)
    with fault(UsageError, str(file), "a split file", found, "trifuse split"):
        read_split(file)
    with fault(UsageError, "none.json", "a split file", "no file"):
        read_split(tmp_path / "none.json")


def test_a_frame_in_two_parts_is_refused(file: Path):
    document = json.loads(file.read_text())
    document["drives"][0]["val"] = document["drives"][0]["train"][:1]
    file.write_text(json.dumps(document))
    with fault(UsageError, "split of training", found="in train and val"):
        read_split(file)


def test_lists_make_the_round_trip(make_drive: MakeDrive, tmp_path: Path):
    drive = make_drive(10)
    (tmp_path / "train.txt").write_text("000009\n000003\n\n000003\n")
    (tmp_path / "val.txt").write_text("5\n")
    split = split_by_lists([drive], tmp_path)
    again: FrameSplit = read_split(write_split(tmp_path / "split.json", split).file)
    assert again.fingerprint == split.fingerprint
    assert names(again.select([drive], "train")) == ["000003", "000009"]
    assert names(again.select([drive], "val")) == ["000005"]
    assert again.parts == ("train", "val")


@pytest.mark.parametrize(
    ("text", "where", "expected", "found"),
    [
        ("3\n70\n", "val.txt row 2", "10 frames of the drive, 000000 to 000009", "'70'"),
        ("three\n", "val.txt row 1", "10 frames of the drive, 000000 to 000009", "'three'"),
        ("\n", "val.txt", "names of frames, one a line", "none"),
    ],
)
def test_a_list_that_does_not_fit_the_drive_is_refused(
    make_drive: MakeDrive, tmp_path: Path, text, where, expected, found
):
    (tmp_path / "train.txt").write_text("5\n")
    (tmp_path / "val.txt").write_text(text)
    with fault(LabelError, where, expected, found):
        split_by_lists([make_drive(10)], tmp_path)


def test_lists_are_of_one_drive_and_share_no_frame(make_drive: MakeDrive, tmp_path: Path):
    with fault(UsageError, "--lists", found="none of them for 1 drives"):
        split_by_lists([make_drive(3)], tmp_path)
    for part in ("train", "val"):
        (tmp_path / f"{part}.txt").write_text("1\n")
    with fault(UsageError, "--lists", found="train.txt, val.txt for 2 drives"):
        split_by_lists([make_drive(3), make_drive(3, "other")], tmp_path)
    with fault(UsageError, "split of training", found="000001 in train and val"):
        split_by_lists([make_drive(3)], tmp_path)
