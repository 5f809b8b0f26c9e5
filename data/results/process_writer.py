"""A writer in a process of its own: what it computes takes no time from the threads of the pipeline."""

import os
import pickle
import signal
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.resource_tracker import ensure_running
from operator import methodcaller
from typing import Any

from data.results.result_writer import ResultWriter
from perception.errors import PerceptionError
from perception.render.scene import SelectedObject
from perception.types import Result

# Copies each array once.
_PICKLE_PROTOCOL = 5
# The pipeline goes first where both want a core.
_NICENESS = 5


class ProcessWriter(ResultWriter):
    """Calls another writer in a process; an error there is raised by the call.

    The process starts, and loads what draws, before the first frame comes; the writer is made by `start`, when the
    folder of the results is there.
    """

    def __init__(self, name: str) -> None:
        """Start the process.

        Args:
            name: Name of what is written, for the error where the process is killed.
        """
        self._name, self._has_writer = name, False
        context = get_context("spawn")
        self._connection, far = context.Pipe()
        self._process = context.Process(target=_serve, args=(far,), daemon=True)
        # A terminal or service stops all processes; that is for this one, which closes the other.
        ensure_running()  # which unblocks them, of a process that starts first
        stops = {signal.SIGINT, signal.SIGTERM}
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, stops)
        try:
            self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        far.close()

    def start(self, make: Callable[[], ResultWriter]) -> None:
        """Make the writer.

        Args:
            make: Function that makes it; it can be pickled.
        """
        self._call(make)
        self._has_writer = True

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Write the next frame."""
        self._call(methodcaller("add", result, selected))

    def snapshot(self) -> bytes:
        """Return the snapshot of the writer."""
        snapshot: bytes = self._call(methodcaller("snapshot"))
        return snapshot

    def restore(self, snapshot: bytes) -> None:
        """Restore the writer."""
        self._call(methodcaller("restore", snapshot))

    def close(self, *, is_complete: bool) -> None:
        """Close the writer, and end the process."""
        try:
            if self._has_writer:
                self._call(methodcaller("close", is_complete=is_complete))
        finally:
            self._connection.close()
            self._process.join()

    def _call(self, function: Callable[..., object]) -> Any:  # noqa: ANN401 - of any method
        """Return what a function of the writer returns in the process; the first function makes the writer.

        Raises:
            PerceptionError: The process was killed.
        """
        try:
            self._connection.send_bytes(pickle.dumps(function, _PICKLE_PROTOCOL))
            reply = self._connection.recv()
        except (EOFError, OSError) as error:
            self._process.join()
            raise PerceptionError(
                self._name,
                expected="its process to run until the end",
                found=f"exit code {self._process.exitcode}",
                advice="repeat the command with more free memory, or without the video by --no-video",
            ) from error
        if isinstance(reply, BaseException):
            raise reply
        return reply


def _serve(connection: Connection) -> None:
    """Make a writer, and call its methods as the other end of a connection asks for, until that is closed."""
    _load_drawing()
    writer: ResultWriter | None = None
    while True:
        try:
            function = pickle.loads(connection.recv_bytes())
        except EOFError:  # the run has ended, or was killed
            return
        reply = None
        try:
            if writer is None:
                writer = function()
            else:
                reply = function(writer)
        except Exception as error:
            reply = error
        connection.send(reply)


def _load_drawing() -> None:
    """Load what draws and encodes, with few threads and heaps, and give way to the pipeline."""
    import data.results.run_video  # noqa: F401
    from perception.geometry.threads import limit_opencv_threads
    from perception.kernels.compiled import load_compiled
    from perception.pipeline.memory import limit_heaps, release_compiler

    os.nice(_NICENESS)
    limit_heaps()
    limit_opencv_threads()
    load_compiled()
    release_compiler()
