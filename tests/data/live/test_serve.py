"""From a source to the viewers."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace

import pytest

from data.live.serve import LiveCounts, serve_results
from data.live.source import LiveSource
from perception.errors import ScanError
from perception.pipeline.stream import ResultStream
from perception.sensor import VLP_16
from tests.known_result import known_result

PERIOD_S = 0.01


class Clockwork(LiveSource):
    """Frames at a fixed rate, whether anybody is ready or not."""

    def __init__(self, frames: int, laps: int = 1) -> None:
        super().__init__("clockwork", VLP_16, is_sequence=True)
        self._frames, self._laps, self.is_closed = frames, laps, threading.Event()
        self._passed = threading.Semaphore(0)

    def laps(self):
        for _ in range(self._laps):
            yield self._lap()

    def _lap(self):
        for index in range(self._frames):
            if self.is_closed.wait(PERIOD_S):
                return
            self._passed.release()
            yield replace(known_result(0).frame, index=index)
        self._passed.release(5 * self._frames)  # for those that are still in work

    def pass_five(self) -> None:
        """Wait until five more frames have come."""
        for _ in range(5):
            self._passed.acquire()

    def close(self) -> None:
        self.is_closed.set()


class SlowPipeline:
    """Takes the time of some frames for each, as `Pipeline` would on a small computer."""

    def __init__(self, wait: Callable[[], None] = lambda: None, bad_index: int = -1) -> None:
        self._wait, self._bad_index = wait, bad_index
        self._worker, self.resets = ThreadPoolExecutor(1), 0

    def reset(self) -> None:
        self.resets += 1

    def stream(self, frames, policy, *, is_sequence):
        assert (policy, is_sequence) == ("latest", True)
        return ResultStream(frames, self._submit, policy, max_in_flight=2)

    def _submit(self, frame, arrival_s) -> Future:
        del arrival_s

        def work():
            self._wait()
            if frame.index == self._bad_index:
                raise ScanError("frame 13", expected="points", found="none")
            return replace(known_result(0), frame=frame)

        return self._worker.submit(work)


class Shelf:
    """Keeps what is published."""

    def __init__(self) -> None:
        self.indices = []

    def publish(self, result) -> None:
        self.indices.append(result.frame.index)


def test_a_slow_pipeline_drops_frames_and_does_not_lag():
    shelf, counts = Shelf(), LiveCounts()
    source = Clockwork(100)
    serve_results(source, SlowPipeline(source.pass_five), [shelf], counts)
    assert counts.published == len(shelf.indices) < 40
    assert counts.published + counts.dropped == 100
    assert shelf.indices == sorted(shelf.indices)
    assert shelf.indices[-1] == 99
    assert counts.text() == (
        f"frames published: {counts.published}, dropped as later ones were there: {counts.dropped}"
    )


def test_each_lap_starts_with_a_fresh_pipeline():
    pipeline, counts = SlowPipeline(), LiveCounts()
    source = Clockwork(5, laps=3)
    serve_results(source, pipeline, [Shelf()], counts)
    assert (pipeline.resets, counts.published + counts.dropped) == (3, 15)
    assert source.is_closed.is_set()


def test_an_error_closes_the_source():
    source = Clockwork(1000)
    with pytest.raises(ScanError, match="frame 13"):
        serve_results(source, SlowPipeline(bad_index=13), [Shelf()], LiveCounts())
    assert source.is_closed.is_set()


def test_an_interrupt_closes_the_source_at_once():
    def interrupt(result) -> None:
        if result.frame.index > 2:
            raise KeyboardInterrupt

    source, start_s = Clockwork(10_000), time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        serve_results(source, SlowPipeline(), [Shelf()], LiveCounts(), on_result=interrupt)
    assert source.is_closed.is_set()
    assert time.perf_counter() - start_s < 5
