"""A writer in a thread beside the pipeline."""

from collections import deque
from concurrent.futures import Future

from data.results.result_writer import ResultWriter
from perception.pipeline.workers import ThreadWorker
from perception.render.scene import SelectedObject
from perception.types import Result

# Bounds the memory of frames that wait to be written.
_MAX_QUEUED = 2


class BackgroundWriter(ResultWriter):
    """Runs another writer in a thread; its errors are raised by the next call."""

    def __init__(self, writer: ResultWriter, name: str) -> None:
        """Start the thread.

        Args:
            writer: Writer that runs in the thread.
            name: Name of the thread.
        """
        self._writer, self._worker = writer, ThreadWorker(name)
        self._queue: deque[Future[None]] = deque()

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Queue the next frame; wait while the queue is full."""
        self._wait_for(_MAX_QUEUED - 1)
        self._queue.append(self._worker.submit(self._writer.add, result, selected))

    def snapshot(self) -> bytes:
        """Write the queue; return the snapshot of the writer."""
        self._wait_for(0)
        return self._writer.snapshot()

    def restore(self, snapshot: bytes) -> None:
        """Restore the writer."""
        self._writer.restore(snapshot)

    def close(self, *, is_complete: bool) -> None:
        """Write the queue and finish; incomplete where something goes wrong meanwhile."""
        is_written = False
        try:
            self._wait_for(0)
            is_written = True
        finally:
            self._worker.close()
            self._writer.close(is_complete=is_complete and is_written)

    def _wait_for(self, length: int) -> None:
        while len(self._queue) > length:
            self._queue.popleft().result()
