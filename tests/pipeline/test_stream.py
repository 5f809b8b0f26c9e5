"""Frames in, results out: order, bounds, drops, faults and the end, with work that the test holds back."""

import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
import pytest

from perception.errors import ScanError
from perception.pipeline.pipeline import frames_in_flight
from perception.pipeline.stream import ResultStream
from perception.types import Frame

PATIENCE_S = 5.0


def frame(index: int) -> Frame:
    return Frame(index, index / 10, np.ones((1, 4), np.float32))


@dataclass
class Work:
    """Begins frames; each is done when the test says so, and its result is its number."""

    submitted: dict[int, Future] = field(default_factory=dict)
    arrived: threading.Condition = field(default_factory=threading.Condition)

    def submit(self, frame: Frame, arrival_s: float) -> Future:
        with self.arrived:
            self.submitted[frame.index] = Future()
            self.arrived.notify_all()
        return self.submitted[frame.index]

    def wait_for(self, *indices: int) -> None:
        with self.arrived:
            assert self.arrived.wait_for(lambda: set(indices) <= set(self.submitted), PATIENCE_S)

    def finish(self, index: int) -> None:
        self.wait_for(index)
        self.submitted[index].set_result(index)


class Lidar:
    """A source that gives a frame when the test says so."""

    def __init__(self) -> None:
        self._turns = threading.Semaphore(0)
        self._asked = threading.Semaphore(0)
        self._is_exhausted = False
        self.count = 0

    def __iter__(self):
        return self

    def __next__(self) -> Frame:
        self._asked.release()
        self._turns.acquire()
        if self._is_exhausted:
            raise StopIteration
        self.count += 1
        return frame(self.count - 1)

    def give(self) -> None:
        """Give one frame to whoever asks."""
        self._turns.release()

    def turn(self) -> None:
        """Give one frame, and return when it has been taken and the next is asked for."""
        assert self._asked.acquire(timeout=PATIENCE_S)
        self.give()
        assert self._asked.acquire(timeout=PATIENCE_S)
        self._asked.release()

    def stop(self) -> None:
        self._is_exhausted = True
        self._turns.release()


def test_results_come_in_the_order_of_frames_whatever_is_done_first():
    work = Work()
    with ResultStream(map(frame, range(4)), work.submit, "every", max_in_flight=2) as stream:
        work.wait_for(0, 1)
        work.finish(1)
        work.finish(0)
        assert [next(stream), next(stream)] == [0, 1]
        work.finish(3)
        work.finish(2)
        assert list(stream) == [2, 3]


def test_no_more_frames_are_read_than_the_queue_holds():
    work, read = Work(), []

    def source():
        for index in range(10):
            read.append(index)
            yield frame(index)

    with ResultStream(source(), work.submit, "every", max_in_flight=3) as stream:
        work.wait_for(0, 1, 2)
        for index in range(3):
            work.finish(index)
        # They are done, but nobody has taken them.
        time.sleep(0.02)
        assert (sorted(work.submitted), read) == ([0, 1, 2], [0, 1, 2])
        assert next(stream) == 0
        work.wait_for(3)
        assert read == [0, 1, 2, 3]
        work.finish(3)
    assert stream.dropped == 0


def test_the_latest_frame_takes_the_place_of_those_that_wait():
    work, lidar = Work(), Lidar()
    with ResultStream(lidar, work.submit, "latest", max_in_flight=1) as stream:
        for _ in range(5):
            lidar.turn()
        work.finish(0)
        assert next(stream) == 0
        work.finish(4)
        assert next(stream) == 4
        assert sorted(work.submitted) == [0, 4]
        assert stream.dropped == 3
        lidar.stop()
        assert list(stream) == []


def test_a_slow_source_loses_no_frame_under_either_policy():
    for policy in ("every", "latest"):
        lidar = Lidar()
        with (
            ThreadPoolExecutor(1) as executor,
            ResultStream(
                lidar, lambda f, _: executor.submit(lambda: f.index), policy, max_in_flight=1
            ) as stream,
        ):
            for index in range(3):
                lidar.give()
                assert next(stream) == index
            lidar.stop()
            assert list(stream) == []
            assert stream.dropped == 0


def test_an_error_comes_in_its_turn_and_is_the_last():
    work = Work()
    with ResultStream(map(frame, range(5)), work.submit, "every", max_in_flight=3) as stream:
        work.wait_for(0, 1, 2)
        work.submitted[1].set_exception(ScanError("frame 1", expected="points", found="none"))
        work.finish(2)
        work.finish(0)
        assert next(stream) == 0
        work.wait_for(3)
        work.finish(3)
        with pytest.raises(ScanError) as error:
            next(stream)
        assert error.value.where == "frame 1"
        assert list(stream) == []
    assert 4 not in work.submitted


def test_an_error_of_the_source_comes_after_the_frames_before_it():
    def source():
        yield frame(0)
        raise ScanError("0001.bin", expected="a whole file", found="half of one")

    work = Work()
    with ResultStream(source(), work.submit, "every", max_in_flight=2) as stream:
        work.finish(0)
        assert next(stream) == 0
        with pytest.raises(ScanError) as error:
            next(stream)
        assert error.value.where == "0001.bin"
        assert list(stream) == []


def test_closing_waits_for_running_frames_and_ends_the_reader():
    closed, work = [], Work()

    def source():
        try:
            for index in range(100):
                yield frame(index)
        finally:
            closed.append(threading.current_thread().name)

    stream = ResultStream(source(), work.submit, "every", max_in_flight=2)
    work.wait_for(0, 1)
    ender = threading.Thread(target=stream.close)
    ender.start()
    ender.join(0.02)
    assert ender.is_alive()
    work.finish(0)
    work.finish(1)
    ender.join(PATIENCE_S)
    assert not ender.is_alive()
    assert closed == ["source"]
    assert list(stream) == []
    assert "source" not in {thread.name for thread in threading.enumerate()}


@pytest.mark.parametrize(("cores", "in_flight"), [(1, 1), (2, 1), (3, 1), (4, 2), (64, 2)])
def test_a_frame_has_two_cores_to_itself(cores, in_flight, monkeypatch):
    monkeypatch.setattr("os.sched_getaffinity", lambda process: set(range(cores)))
    assert frames_in_flight() == in_flight
