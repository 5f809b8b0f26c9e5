"""Files on a full disk, and in places that cannot be written to: whole or absent, and one sentence."""

import errno
import os

import numpy as np
import pytest

from perception.atomic_file import append_atomically, atomic_file, write_atomically, write_jpeg
from perception.errors import WriteError
from perception.render.figure import new_figure, save_figure
from perception.render.video import VideoWriter
from tests.faults import fault
from tests.full_disk import file_size_limit

NOISE = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)
WRITERS = {
    "bytes": lambda path: write_atomically(path, bytes(10_000)),
    "lines": lambda path: append_atomically(path, bytes(10_000)),
    "jpeg": lambda path: write_jpeg(path, NOISE),
    "figure": lambda path: save_figure(new_figure(3, 3, "noise"), path),
}


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
def test_a_full_disk_leaves_the_older_file_and_no_part(tmp_path, write):
    path = tmp_path / "file.png"
    path.write_bytes(b"older")
    with file_size_limit(2000), fault(WriteError, str(path), found="File too large", advice="room"):
        write(path)
    assert path.read_bytes() == b"older"
    assert list(tmp_path.iterdir()) == [path]


def test_processes_may_write_the_same_file_at_the_same_time(tmp_path, monkeypatch):
    path = tmp_path / "folder" / "sensor.json"
    with atomic_file(path) as one:
        one.write_text("{")
        monkeypatch.setattr("os.getpid", lambda: 1)
        write_atomically(path, b"{}")  # another process is faster
        assert path.read_text() == "{}"
        one.write_text('{"beams": 64}')
    assert path.read_text() == '{"beams": 64}'
    assert list(path.parent.iterdir()) == [path]


def test_a_full_disk_ends_a_video_with_its_name(tmp_path):
    path = tmp_path / "video.mp4"
    with (
        file_size_limit(2000),
        fault(WriteError, str(path), found="File too large"),
        VideoWriter(path) as video,
    ):
        for _ in range(3):
            video.add(NOISE)
    assert not path.exists()


@pytest.mark.parametrize(
    ("number", "advice"),
    [
        (errno.ENOSPC, "make room"),
        (errno.EDQUOT, "make room"),
        (errno.EROFS, "that you may write to"),
        (errno.EACCES, "that you may write to"),
        (errno.EISDIR, "another path"),
    ],
)
def test_every_error_of_the_system_names_the_file(tmp_path, number, advice):
    path = tmp_path / "folder" / "file.npz"
    found = os.strerror(number)
    with fault(WriteError, str(path), found=found, advice=advice), atomic_file(path) as part:
        part.write_bytes(b"begun")
        raise OSError(number, found)
    assert list(path.parent.iterdir()) == []


def test_a_file_in_the_place_of_a_folder_is_named(tmp_path):
    (tmp_path / "taken").write_bytes(b"")
    with fault(WriteError, str(tmp_path / "taken" / "file"), found="File exists"):
        write_atomically(tmp_path / "taken" / "file", b"data")


def test_an_interrupt_leaves_no_part(tmp_path):
    with pytest.raises(KeyboardInterrupt), atomic_file(tmp_path / "file.npz") as part:
        part.write_bytes(b"begun")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_appended_data_follow_each_other(tmp_path):
    path = tmp_path / "made" / "lines.txt"
    for line in (b"one\n", b"", b"two\n"):
        append_atomically(path, line)
    assert path.read_bytes() == b"one\ntwo\n"
