"""`trifuse split` and `--split`: what is written and printed, and the frames that other commands take."""

import json
from pathlib import Path

import pytest

from data.open_drive import open_drive, open_drives
from data.splits.files import read_split, write_split
from data.splits.frame_split import DriveParts, FrameSplit
from data.splits.training_frames import ENTRY, TrainingFrames
from perception.cli.flags import LabelledDriveFlags
from perception.errors import UsageError
from tests.car_frames import write_car_frames
from tests.detection.bright_cells import bright_cells
from tests.faults import command, fault


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    return write_car_frames(tmp_path / "object", frames=10)


@pytest.fixture
def file(frames: Path, tmp_path: Path, capsys) -> Path:
    command("split", frames, "--shares", "60,20,20", "--out", tmp_path / "split.json")
    return tmp_path / "split.json"


def test_a_split_is_written_and_its_parts_are_counted(file: Path, capsys):
    split = read_split(file)
    assert (split.by, split.shares, split.seed) == ("frames", (60, 20, 20), 0)
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["train", "6", "1", "12"] in rows
    assert ["test", "2", "1", "4"] in rows
    assert split.fingerprint in " ".join(rows[0])


def test_lists_are_read_instead(frames: Path, tmp_path: Path, capsys):
    lists = tmp_path / "ImageSets"
    lists.mkdir()
    (lists / "train.txt").write_text("000001\n000004\n")
    (lists / "val.txt").write_text("000007\n")
    command("split", frames, "--lists", lists, "--out", tmp_path / "lists.json")
    split = read_split(tmp_path / "lists.json")
    assert split.drives[0].frames == {"train": ("000001", "000004"), "val": ("000007",)}
    assert split.seed is None
    assert str(lists) in capsys.readouterr().out


def test_frames_without_labels_cannot_be_split(frames: Path, tmp_path: Path):
    labels = frames / "training" / "label_2"
    labels.rename(tmp_path / "away")
    with fault(UsageError, "training", "labelled boxes", "none of training"):
        command("split", frames, "--out", tmp_path / "split.json")


def evaluate(frames: Path, model: Path, out: Path, *words: object) -> dict:
    command("evaluate", "detection", frames, "--detector", model, "--json", out, *words)
    return json.loads(out.read_text())


def test_a_part_is_evaluated_and_its_learned_frames_are_counted(
    frames: Path, file: Path, tmp_path: Path, caplog, capsys
):
    (learned,) = read_split(file).select([open_drive(frames)], "train")
    text = TrainingFrames.of([learned]).text
    model, out = tmp_path / "dm.onnx", tmp_path / "metrics.json"
    model.write_bytes(bright_cells("dm", **{ENTRY: text}))
    document = evaluate(frames, model, out, "--split", file)
    (data,) = document["data"]
    assert (data["part"], data["frames_evaluated"]) == ("test", 2)
    assert data["seen_in_training"] == {"frames": 2, "learned": {"dm": 0}}
    assert ENTRY not in document["networks"]["dm"]
    assert document["configuration"]["split"] == str(file)
    printed = capsys.readouterr().out
    assert "frames seen in training: 0 of 2 (dm)" in printed
    assert "(real, part test, 2 frames)" in printed
    assert caplog.records == []
    document = evaluate(frames, model, out)
    assert document["data"][0]["seen_in_training"]["learned"] == {"dm": 6}
    (record,) = caplog.records
    assert record.args == (str(frames), "dm")


def test_a_part_is_of_a_split_that_has_it(frames: Path, file: Path, tmp_path: Path):
    words = ("evaluate", "detection", frames, "--detector", "depthcn")
    with fault(UsageError, "--part val", "--split FILE beside it"):
        command(*words, "--part", "val")
    command("split", frames, "--shares", "80,20", "--out", file)
    with fault(UsageError, "--part test", found="train, val"):
        command(*words, "--split", file)
    other = write_car_frames(tmp_path / "other", frames=10)
    (other / "training").rename(other / "velodyne_of_another")
    with fault(UsageError, str(file), "a split of velodyne_of_another"):
        command("evaluate", "detection", other / "velodyne_of_another", "--split", file)


def test_a_sequence_is_evaluated_whole(tmp_path: Path):
    objects, root = write_car_frames(tmp_path, frames=2) / "training", tmp_path / "tracking"
    for name in ("velodyne", "calib", "label_02"):
        (root / name).mkdir(parents=True)
    (objects / "velodyne").rename(root / "velodyne" / "0000")
    (objects / "calib" / "000000.txt").rename(root / "calib" / "0000.txt")
    (root / "label_02" / "0000.txt").touch()
    (drive,) = open_drives([root])
    file, (first, second) = tmp_path / "split.json", drive.scans.names
    for frames, found in (
        ({"train": (first,), "val": (second,)}, "1 of them"),
        ({"train": (first, second)}, "none; it has train"),
    ):
        write_split(file, FrameSplit((DriveParts(drive.root, drive.name, frames),)))
        with fault(UsageError, found=found):
            command("evaluate", "ground", root, "--split", file, "--part", "val")
    assert len(LabelledDriveFlags(split=file, part="train").reader().open(root)) == 2
