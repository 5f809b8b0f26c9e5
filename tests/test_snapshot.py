"""State as a file: what comes back is the same to the last bit, and what comes from strangers runs nothing."""

import io
import json
from array import array
from collections import deque
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest

from perception.errors import DriveError
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.snapshot import NotStorableError, Restorable, read_snapshot, write_snapshot
from perception.types import HealthLevel
from tests.faults import fault


class Counter(Restorable):
    """An object that remembers a number."""

    memories = ("count",)

    def __init__(self):
        self.count = 0


def again(value):
    return read_snapshot(write_snapshot(value), "test")


@pytest.mark.parametrize(
    "value",
    [
        None,
        0.1 + 0.2,
        float("-inf"),
        2**70,
        "π",
        b"\x00\xff",
        [1, [2.5, None]],
        (1, ("a",)),
        {(1, 2): {3}, "a": frozenset({4})},
        deque([1, 2], maxlen=2),
        array("d", [0.1, 0.2]),
        Path("a/b"),
        HealthLevel.WARN,
        np.float32(0.1),
    ],
    ids=str,
)
def test_values_come_back_as_they_were(value):
    found = again(value)
    assert found == value
    assert type(found) is type(value)


def test_a_deque_keeps_its_length():
    assert again(deque([1, 2], maxlen=2)).maxlen == 2


@pytest.mark.parametrize(
    "made",
    [
        np.arange(6.0).reshape(2, 3),
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.arange(12.0).reshape(3, 4)[::2, 1:],
        np.arange(6)[::-1],
        np.zeros((0, 3), np.float32),
        np.array(["ab", "c"]),
        np.array([(1, 2.5)], [("index", "<i4"), ("seconds", "<f8", (1,))]),
        np.array(7.5),
    ],
    ids=["rows", "columns", "part", "reversed", "empty", "text", "fields", "scalar"],
)
def test_arrays_keep_their_layout(made):
    found = again(made)
    assert found.dtype == made.dtype
    assert found.strides == made.strides
    assert found.tobytes() == made.tobytes()


def test_what_is_shared_stays_shared():
    points = np.zeros((4, 3))
    window, part = again(({"all": points}, points[1:3]))
    part[0] = 1
    assert window["all"][1].tolist() == [1, 1, 1]
    loop = []
    loop.append(loop)
    found = again(loop)
    assert found[0] is found


def test_random_numbers_go_on_where_they_were():
    random = np.random.default_rng(3)
    random.normal(size=5)
    assert again(random).normal() == random.normal()


def test_objects_are_made_without_being_called():
    window = ScanWindow(previous_scans=1)
    window.push(PosedScan(np.ones((2, 4), np.float32), np.eye(4)))
    found = again(window)
    assert isinstance(found, ScanWindow)
    assert found.newest.points_velo.tolist() == window.newest.points_velo.tolist()
    found.push(found.newest)
    found.push(found.newest)
    assert len(found) == 2


def test_equal_states_are_equal_files():
    assert write_snapshot({"a": np.arange(3)}) == write_snapshot({"a": np.arange(3)})


@pytest.mark.parametrize(
    "value",
    [io.BytesIO(), print, np.array([object()]), ZipFile],
    ids=["file", "call", "o", "class"],
)
def test_what_has_no_place_in_a_file_is_named(value):
    with pytest.raises(NotStorableError):
        write_snapshot([value])


def snapshot_of(nodes, *, compression=0):
    file = io.BytesIO()
    with ZipFile(file, "w", compression) as archive:
        archive.writestr("document.json", json.dumps({"root": [0], "nodes": nodes}))
        archive.writestr("bytes_0", bytes(8))
    return file.getvalue()


ARRAY = {"array": 0, "dtype": "<f8", "shape": [1], "offset": 0, "strides": [8]}


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"PK",
        snapshot_of([{"class": "subprocess:Popen", "fields": {}}]),
        snapshot_of([{"class": "perception.snapshot:np.ndarray", "fields": {}}]),
        snapshot_of([{"class": "perception.__main__:main", "fields": {}}]),
        snapshot_of([{"class": "perception.cli.main:main", "fields": {}}]),
        snapshot_of([{"enum": "perception.localization.scan_window:PosedScan", "name": "a"}]),
        snapshot_of([{"list": [[1]]}]),
        snapshot_of([{"tuple": [[0]]}]),
        snapshot_of([{"unknown": 1}]),
        snapshot_of([{**ARRAY, "dtype": "|O", "is_writeable": True}]),
        snapshot_of([{**ARRAY, "shape": [2], "is_writeable": True}]),
        snapshot_of([{**ARRAY, "offset": -8, "is_writeable": True}]),
        snapshot_of([{**ARRAY, "shape": [1 << 40], "strides": [8], "is_writeable": True}]),
        snapshot_of([{**ARRAY, "array": 3, "is_writeable": True}]),
        snapshot_of([{"list": []}], compression=ZIP_DEFLATED),
    ],
    ids=[
        "empty", "cut", "foreign class", "class through a module", "program", "function",
        "no enumeration", "no node", "endless", "unknown", "objects", "beyond its memory",
        "before its memory", "huge", "no memory", "compressed",
    ],
)  # fmt: skip
def test_a_file_of_a_stranger_runs_nothing_and_is_one_sentence(data):
    with fault(DriveError, where="state.zip", found="a damaged file"):
        read_snapshot(data, "state.zip")


def test_a_state_of_another_kind_is_not_taken():
    counter = Counter()
    for state in ({"count": "1"}, {"others": 1}, 3):
        with fault(DriveError, where="Counter"):
            counter.restore(write_snapshot(state))
    assert counter.count == 0
