"""Stream of frames in and results out, in order: every frame, or the latest of those that arrived.

source -- read --> pending (at most one) -- submit --> in flight (few) -- next --> result

A frame is submitted when fewer than the largest number are in flight, and leaves when its result is taken: a slow
consumer makes the source wait, or frames are dropped. Memory is bounded either way.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future, wait
from typing import Literal, Self

from perception.types import Frame, Result

# Treatment of frames that arrive faster than results are taken.
FramePolicy = Literal["every", "latest"]
Submit = Callable[[Frame, float], "Future[Result]"]
# Longest wait for a source that gives no more frames.
_JOIN_TIMEOUT_S = 1.0


class ResultStream:
    """An iterator over results; a context manager, which finishes submitted frames."""

    def __init__(
        self, frames: Iterable[Frame], submit: Submit, policy: FramePolicy, max_in_flight: int
    ) -> None:
        """Start reading.

        Args:
            frames: Frames in order; they are read in a thread of their own.
            submit: Function that starts the work on a frame, given its arrival time by `time.perf_counter`.
            policy: Every frame, for which the source waits; or the latest, for a source that does not wait.
            max_in_flight: Largest number of frames that are started and not yet taken.
        """
        self.dropped = 0
        """Number of frames that were dropped as a later one arrived first."""
        self._submit, self._policy, self._max_in_flight = submit, policy, max_in_flight
        self._in_flight: deque[Future[Result]] = deque()
        self._pending: tuple[Frame, float] | None = None
        self._is_exhausted = self._is_closed = False
        self._source_error: Exception | None = None
        self._changed = threading.Condition()
        self._reader = threading.Thread(
            target=self._read, args=(frames,), name="source", daemon=True
        )
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Result:
        """Return the result of the next frame.

        Raises:
            PerceptionError: this frame could not be read or used; the stream ends with it.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._in_flight or self._is_exhausted or self._is_closed)
            if self._is_closed:
                raise StopIteration
            if not self._in_flight:
                self._is_closed = True
                raise self._source_error or StopIteration
            oldest = self._in_flight[0]
        try:
            result = oldest.result()
        except BaseException:
            self.close()
            raise
        self._release()
        return result

    def close(self) -> None:
        """Stop reading, and wait for submitted frames; their results are lost."""
        with self._changed:
            self._is_closed = True
            self._pending = None
            self._changed.notify_all()
        wait(self._in_flight)
        self._in_flight.clear()
        self._reader.join(_JOIN_TIMEOUT_S)

    def _read(self, frames: Iterable[Frame]) -> None:
        """Read frames from the source until it ends, fails, or the stream is closed."""
        source = iter(frames)
        try:
            while self._waits_for_more():
                try:
                    frame = next(source)
                except StopIteration:
                    return
                self._accept(frame, time.perf_counter())
        except Exception as error:  # raised to the consumer after the last result
            self._source_error = error
        finally:
            # A generator is closed in the thread that ran it.
            del source, frames
            with self._changed:
                self._is_exhausted = True
                self._changed.notify_all()

    def _waits_for_more(self) -> bool:
        """Wait for room under the policy `every`; return whether to read another frame."""
        with self._changed:
            if self._policy == "every":
                self._changed.wait_for(lambda: self._has_room or self._is_closed)
            return not self._is_closed

    def _accept(self, frame: Frame, arrival_s: float) -> None:
        with self._changed:
            self.dropped += self._pending is not None
            self._pending = (frame, arrival_s)
            self._submit_pending()

    def _release(self) -> None:
        """Submit the pending frame in the place of a taken result."""
        with self._changed:
            self._in_flight.popleft()
            self._submit_pending()

    def _submit_pending(self) -> None:
        if self._pending is not None and self._has_room and not self._is_closed:
            self._in_flight.append(self._submit(*self._pending))
            self._pending = None
        self._changed.notify_all()

    @property
    def _has_room(self) -> bool:
        return len(self._in_flight) < self._max_in_flight
