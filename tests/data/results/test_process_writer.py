"""A writer in a process of its own: the same files, its errors here, and a sentence where the process is killed."""

import os
import signal
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from data.results.process_writer import ProcessWriter
from data.results.result_writer import ResultWriter, open_writers
from data.results.run_video import RunVideo
from perception.errors import PerceptionError, WriteError
from perception.render.composition import Composition
from tests.render.conftest import scene  # noqa: F401 - fixture

LAYOUT = Composition(size_px=(640, 360))


class ProcessIdWriter(ResultWriter):
    """Writes the process in which it is called; fails at frame 2."""

    def __init__(self, path: Path):
        self._path = path

    def add(self, result, selected):
        if result == 2:
            raise WriteError(self._path, expected="room", found="none")
        if result == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        with self._path.open("a") as file:
            file.write(f"{os.getpid()} {result}\n")

    def snapshot(self):
        return self._path.read_bytes()

    def close(self, *, is_complete):
        self.add(is_complete, None)


@pytest.fixture
def process(tmp_path: Path):  # its log lies there until it is closed
    writer = ProcessWriter("test")
    yield writer
    writer.close(is_complete=True)


def test_an_error_of_the_writer_is_raised_here_and_the_writer_goes_on(process, tmp_path):
    path = tmp_path / "log"
    process.start(partial(ProcessIdWriter, path))
    process.add(0, None)
    with pytest.raises(WriteError, match=r"log: expected room, found none"):
        process.add(2, None)
    process.add(1, None)
    lines = [line.split() for line in process.snapshot().decode().splitlines()]
    assert [line[1] for line in lines] == ["0", "1"]
    assert {line[0] for line in lines} == {str(process._process.pid)} != {str(os.getpid())}


def test_what_stops_all_processes_is_left_to_the_one_that_closes_the_writer(process, tmp_path):
    process.start(partial(ProcessIdWriter, tmp_path / "log"))
    for stop in (signal.SIGINT, signal.SIGTERM):
        os.kill(process._process.pid, stop)
    process.add(0, None)
    assert process.snapshot().decode().endswith(" 0\n")


def test_a_process_that_is_killed_ends_the_run_with_a_sentence(tmp_path):
    process = ProcessWriter("video")
    process.start(partial(ProcessIdWriter, tmp_path / "log"))
    with pytest.raises(
        PerceptionError, match=r"^video: expected .* found exit code -9; .*--no-video"
    ):
        process.add(3, None)
    with pytest.raises(PerceptionError):
        process.close(is_complete=False)


def test_the_files_are_those_of_the_writer_itself(scene, tmp_path):  # noqa: F811 - fixture
    results = [replace(scene, frame=replace(scene.frame, index=k, stamp_s=0.1 * k)) for k in (0, 1)]
    written = []
    for name in ("here", "there"):
        (tmp_path / name).mkdir()
        make = partial(RunVideo, tmp_path / name, LAYOUT, 2, is_sequence=True)
        video = make() if name == "here" else ProcessWriter("video")
        if name == "there":
            video.start(make)
        with open_writers([video]):
            for result in results:
                video.add(result, None)
        written.append({one.name: one.read_bytes() for one in (tmp_path / name).iterdir()})
    assert written[0] == written[1]
    assert sorted(written[0]) == ["preview.jpg", "video.mp4"]
