"""Bags that are damaged, or hold no drive: one sentence each."""

import contextlib
import sqlite3
import sys
from pathlib import Path

import numpy as np
import pytest

from data.bags.bag import Bag, RawMessage
from data.layouts import OpenConfig
from data.open_drive import open_drive, sequences_in
from perception.errors import DriveError, MissingDependencyError, PerceptionError, UsageError
from tests.bag_writer import FIRST_NS, KINDS, BagWriter, columns_of

SCAN = columns_of(np.random.default_rng(0).uniform(0.1, 0.9, (900, 4)).astype(np.float32))


def write_scans(folder: Path, kind: str = "mcap", topic: str = "/points") -> Path:
    """Write three scans; return the file that holds them."""
    with BagWriter(folder, kind) as bag:
        for index in range(3):
            bag.cloud(topic, FIRST_NS + index * 100_000_000, SCAN)
    files = [bag.path] if bag.path.is_file() else list(bag.path.glob("*.[md][cb]*"))
    return files[0]


def sentence(path: Path, config: OpenConfig | None = None) -> str:
    """Return the one sentence with which a bag is refused."""
    with pytest.raises(PerceptionError) as caught:
        list(open_drive(path, config=config or OpenConfig()))
    message = str(caught.value)
    assert "\n" not in message
    assert not message.endswith(".")
    return message


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.99])
def test_a_truncated_bag_gives_the_command_of_its_repair(
    tmp_path: Path, kind: str, share: float
) -> None:
    path = write_scans(tmp_path / "bag", kind)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    message = sentence(path)
    assert f"{path}: expected a whole bag, found" in message
    assert {"mcap": "mcap recover", "db3": "sqlite3", "ros1": "rosbag reindex"}[kind] in message


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_bytes_never_give_a_traceback(tmp_path: Path, kind: str) -> None:
    path = write_scans(tmp_path / "bag", kind)
    data = bytearray(path.read_bytes())
    rng = np.random.default_rng(5)
    for _ in range(12):
        damaged = data.copy()
        for at in rng.integers(0, len(data), 8):
            damaged[at] ^= 0xFF
        path.write_bytes(damaged)
        try:
            list(open_drive(path))
        except PerceptionError as error:
            assert "\n" not in str(error)


def test_a_file_that_is_no_bag_is_an_error(tmp_path: Path) -> None:
    for suffix in (".bag", ".mcap", ".db3"):
        path = tmp_path / f"notes{suffix}"
        path.write_text("not a bag at all\n" * 40)
        assert f"{path}: expected a whole bag" in sentence(path)


def test_a_damaged_metadata_file_is_an_error(tmp_path: Path) -> None:
    folder = write_scans(tmp_path / "bag").parent
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: [1, 2")
    assert f"{folder}: expected a whole bag" in sentence(folder)


def test_a_missing_part_of_a_bag_is_an_error(tmp_path: Path) -> None:
    path = write_scans(tmp_path / "bag")
    path.rename(path.with_name("other.mcap"))
    assert f"{path.parent}: expected a whole bag" in sentence(path.parent)


def test_a_bag_without_scans_lists_its_topics(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.odometry("/odom", FIRST_NS, np.eye(4))
    expected = "expected messages of type sensor_msgs/msg/PointCloud2, found /odom (nav_msgs/msg/O"
    assert expected in sentence(bag.path)


def test_a_topic_that_is_not_there_gives_a_list(tmp_path: Path) -> None:
    path = write_scans(tmp_path / "bag", topic="/left/points")
    expected = f"--lidar /right: expected topics of {path}: /left/points, found another one"
    assert expected in sentence(path, OpenConfig(lidar="/right"))
    assert "--camera /c: expected topics of" in sentence(path, OpenConfig(camera="/c"))
    assert len(open_drive(path, config=OpenConfig(lidar="left/points"))) == 3


def test_a_message_of_another_type_is_an_error(tmp_path: Path) -> None:
    bag = Bag(write_scans(tmp_path / "bag"))
    with pytest.raises(DriveError, match=r"/points at 1\.000 s: expected a message of type sensor"):
        bag.decode(RawMessage("/points", 1_000_000_000, b"\0\1\0\0abc"))


def test_a_folder_of_bags_holds_sequences(tmp_path: Path) -> None:
    write_scans(tmp_path / "day" / "first")
    write_scans(tmp_path / "day" / "second", "ros1")
    (tmp_path / "day" / "second" / "drive.bag").rename(tmp_path / "day" / "third.bag")
    assert sequences_in(tmp_path / "day") == ["first", "third.bag"]
    assert open_drive(tmp_path / "day", sequence="third.bag").name == "third"
    with pytest.raises(DriveError, match="one of several sequences to be named"):
        open_drive(tmp_path / "day")
    with pytest.raises(UsageError, match="sequence 7: expected none"):
        open_drive(tmp_path / "day" / "third.bag", sequence="7")


def test_a_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_scans(tmp_path / "bag")
    for name in [*sys.modules]:
        if name.split(".")[0] == "rosbags":
            monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingDependencyError, match=r"the Python package rosbags.*\[bags\]"):
        open_drive(path)


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ("UPDATE topics SET name = x'41'", "a topic named b'A'"),
        ("UPDATE topics SET type = x'4142'", "/points of type b'AB'"),
        ("UPDATE messages SET data = 1000000000000", "a message of /points with 1000000000000"),
        ("UPDATE messages SET timestamp = 1.5", "a message of /points at 1.5"),
    ],
)
def test_a_database_with_values_of_other_types_is_refused(
    tmp_path: Path, change: str, found: str
) -> None:
    """SQLite holds a value of any type in every place; a number for bytes would ask for as much memory."""
    path = write_scans(tmp_path / "bag", "db3")
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.executescript(change)
    with pytest.raises(DriveError) as caught:
        bag = Bag(path)
        list(bag.messages(list(bag.kinds)))
    assert f"{path}: expected a whole bag, found" in str(caught.value)
    assert found in str(caught.value)
