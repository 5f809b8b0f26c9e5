"""Frames that detectors learned from are counted, and left out where their fusion is trained."""

import logging
from pathlib import Path

import pytest

from data.detections.config import FusionDataConfig
from data.detections.split_detections import fusion_parts
from data.detections.unlearned_frames import count_learned_frames, without_learned_frames
from data.open_drive import open_drive
from data.recorded_drive import RecordedDrive
from data.samples.config import TrainingDrives
from data.splits.draw import draw_split
from data.splits.files import write_split
from data.splits.training_frames import ENTRY, TrainingFrames
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.errors import UsageError
from perception.types import Modality
from tests.car_frames import write_car_frames
from tests.detection.bright_cells import bright_cells
from tests.faults import fault

Detectors = dict[Modality, ModalityDetector]


@pytest.fixture
def drive(tmp_path: Path) -> RecordedDrive:
    return open_drive(write_car_frames(tmp_path / "cars", frames=10))


def detectors(folder: Path, **learned: RecordedDrive | None) -> Detectors:
    """Open detectors that state the frames they learned from, or none."""
    opened: Detectors = {}
    for modality in ("dm", "rm"):
        stated = learned.get(modality)
        facts = {} if stated is None else {ENTRY: TrainingFrames.of([stated]).text}
        (folder / f"{modality}.onnx").write_bytes(bright_cells(modality, **facts))
        opened[modality] = ModalityDetector(folder / f"{modality}.onnx")
    return opened


def names(drives) -> list[str]:
    return [name for one in drives for name in one.scans.names]


def test_frames_are_counted_of_each_network(drive: RecordedDrive):
    networks = {
        "rgb": {"training_data": "elsewhere"},
        "dm": {ENTRY: TrainingFrames.of([drive.select([0, 1, 2])]).text},
        "rm": {ENTRY: TrainingFrames(frozenset()).text},
    }
    counts = count_learned_frames(networks, drive.select([2, 3, 4]))
    assert counts.learned == {"rgb": None, "dm": 1, "rm": 0}
    assert counts.networks == ["dm"]
    assert str(counts) == "frames seen in training: not known (rgb), 1 of 3 (dm), 0 of 3 (rm)"


def test_learned_frames_are_left_out_one_by_one(drive: RecordedDrive, tmp_path: Path, caplog):
    opened = detectors(tmp_path, dm=drive.select([0, 3]), rm=drive.select([3, 4]))
    with caplog.at_level(logging.WARNING):
        (left,) = without_learned_frames([drive], opened)
    assert left.scans.numbers == (1, 2, 5, 6, 7, 8, 9)
    (record,) = caplog.records
    assert record.args == (3, 10, "dm (dm.onnx), rm (rm.onnx)")


def test_frames_that_are_not_known_are_taken(drive: RecordedDrive, tmp_path: Path, caplog):
    with caplog.at_level(logging.WARNING):
        (left,) = without_learned_frames([drive], detectors(tmp_path, rm=drive.select([0])))
    assert len(left) == 9
    assert caplog.records[0].args == ("dm (dm.onnx)",)


def test_only_learned_frames_are_refused(drive: RecordedDrive, tmp_path: Path):
    opened = detectors(tmp_path, dm=drive, rm=drive.select([1]))
    found = "10 of 10 that dm (dm.onnx), rm (rm.onnx) learned from"
    with fault(UsageError, "drives", "no detector learned from", found, "--split"):
        without_learned_frames([drive], opened)


def test_a_fusion_takes_what_the_detectors_left_of_a_split(drive: RecordedDrive, tmp_path: Path):
    split = draw_split([drive], (50, 30, 20), by="frames", seed=0)
    file = tmp_path / "split.json"
    write_split(file, split)
    frames = split.drives[0].frames
    (learned,) = split.select([drive], "train")
    opened = detectors(tmp_path, dm=learned, rm=learned)
    parts = fusion_parts(TrainingDrives(split=file), FusionDataConfig(), 0, opened)
    assert sorted(names([*parts.train, *parts.val])) == sorted(frames["val"])
    assert (len(names(parts.train)), len(names(parts.val))) == (2, 1)
    assert names(parts.test) == sorted(frames["test"])
    assert parts.split == split.fingerprint


def test_a_fusion_draws_its_test_where_a_split_has_none(drive: RecordedDrive, tmp_path: Path):
    split = draw_split([drive], (50, 50), by="frames", seed=0)
    write_split(tmp_path / "split.json", split)
    (learned,) = split.select([drive], "train")
    opened = detectors(tmp_path, dm=learned, rm=learned)
    sources = TrainingDrives(split=tmp_path / "split.json")
    parts = fusion_parts(sources, FusionDataConfig(), 0, opened)
    counts = [len(names(one)) for one in (parts.train, parts.val, parts.test)]
    assert counts == [3, 1, 1]
    everything = names([*parts.train, *parts.val, *parts.test])
    assert sorted(everything) == sorted(split.drives[0].frames["val"])


def test_validation_drives_of_a_fusion_are_its_test_too(drive: RecordedDrive, tmp_path: Path):
    other = write_car_frames(tmp_path / "other", frames=4)
    opened = detectors(tmp_path, dm=drive.select([9]), rm=drive.select([9]))
    parts = fusion_parts(TrainingDrives((drive.root,), (other,)), FusionDataConfig(), 0, opened)
    assert len(names(parts.train)) == 9
    assert sorted(names([*parts.val, *parts.test])) == [f"{number:06d}" for number in range(4)]
    assert (len(names(parts.val)), len(names(parts.test))) == (2, 2)
