"""Frames that a network learned from are known by their scans, wherever these lie."""

import shutil
from pathlib import Path

import pytest

from data.open_drive import open_drive
from data.splits.training_frames import ENTRY, TrainingFrames, scan_hashes
from perception.errors import ModelError
from tests.car_frames import write_car_frames
from tests.faults import fault


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_car_frames(tmp_path / "cars", frames=4)


def among(frames: TrainingFrames | None, path: Path) -> list[bool]:
    assert frames is not None
    return frames.among(scan_hashes(open_drive(path))).tolist()


def test_frames_are_known_again_from_metadata(folder: Path):
    frames = TrainingFrames.of([open_drive(folder).select([0, 2])])
    again = TrainingFrames.from_metadata({ENTRY: frames.text}, "dm.onnx")
    assert again == frames
    assert among(again, folder) == [True, False, True, False]
    assert TrainingFrames.from_metadata({}, "dm.onnx") is None


def test_a_copy_in_another_layout_under_other_names_is_known(folder: Path, tmp_path: Path):
    frames = TrainingFrames.of([open_drive(folder).select([1])])
    moved = tmp_path / "2011_09_26_drive_0001_sync" / "velodyne_points" / "data"
    moved.mkdir(parents=True)
    for number in range(4):
        scan = folder / "training" / "velodyne" / f"{number:06d}.bin"
        shutil.copy(scan, moved / f"{number + 40:010d}.bin")
    assert among(frames, moved.parents[1]) == [False, True, False, False]


def test_metadata_of_thousands_of_frames_stay_small():
    frames = TrainingFrames(frozenset(number.to_bytes(8) for number in range(4489)))
    assert len(frames.text) <= 48_000


def test_damaged_metadata_are_refused():
    with fault(ModelError, "dm.onnx", ENTRY):
        TrainingFrames.from_metadata({ENTRY: "n$t base64"}, "dm.onnx")


def test_a_scan_that_has_changed_is_another_one(folder):
    drive = open_drive(folder)
    frames, scan = TrainingFrames.of([drive]), drive.scans.paths[1]
    scan.write_bytes(scan.read_bytes()[:-16])
    assert frames.among(scan_hashes(drive)).tolist() == [True, False, True, True]
