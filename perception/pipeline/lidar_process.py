"""The LiDAR stages in a process of their own: Python lets only one thread of a process run at a time.

    this process    step(frame) -- frame without its image -->.
                                                              | LiDAR stages
                    LidarResult <-- or an error --------------'  the other process

The other process starts with this module, so that a script that makes a pipeline is not run a second time. It ends
when it is closed, and when this process ends, for whatever reason.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import IO, Any, cast

from perception.errors import PerceptionError
from perception.geometry.threads import limit_blas_threads, limit_opencv_threads
from perception.pipeline.config import PipelineConfig
from perception.pipeline.lidar_stages import LidarResult, LidarStages
from perception.pipeline.workers import StageClock
from perception.sensor import LidarModel
from perception.types import Frame

# The other process finds modules where this one does. `python -P -c` does not put the working folder first, which may
# hold a user's random.py. An interrupt reaches both processes, from the start; this one ends the other.
_START = (
    "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); sys.path[:] = sys.argv[1:]; "
    f"from {__name__} import serve; serve()"
)


class LidarProcess:
    """The interface of `LidarStages` to another process; one thread at a time may call it."""

    def __init__(self, sensor: LidarModel, config: PipelineConfig) -> None:
        """Start the process; it gets ready in the background.

        Args:
            sensor: LiDAR model of the scans.
            config: Pipeline configuration.

        Raises:
            PerceptionError: no process can be started.
        """
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _START, *map(os.path.abspath, sys.path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
        except OSError as error:
            raise PerceptionError(
                f"process of {sys.executable or 'Python'}",
                expected="a process that can be started for the LiDAR stages",
                found=str(error),
                advice="pass --pipeline.no-parallel",
            ) from error
        self._send((sensor, config))

    @property
    def process_id(self) -> int:
        """Process id."""
        return self._process.pid

    def step(self, frame: Frame, clock: StageClock) -> LidarResult:
        """Run the LiDAR stages on a frame.

        Raises:
            PerceptionError: the error of `LidarStages.step`, or the process has ended.
        """
        return cast(LidarResult, self._call("step", replace(frame, image=None), clock))

    def reset(self) -> None:
        """Forget the drive so far."""
        self._call("reset")

    def close(self) -> None:
        """End the process after the running call."""
        with suppress(BrokenPipeError):  # it has ended by itself
            self._requests.close()
        self._responses.close()
        self._process.wait()

    def _call(self, name: str, *arguments: object) -> Any:  # noqa: ANN401 - what the task of that name returns
        self._send((name, arguments))
        try:
            response = pickle.load(self._responses)
        except (EOFError, pickle.UnpicklingError) as error:
            raise self._ended_error() from error
        if isinstance(response, Exception):
            raise response
        return response

    def _send(self, message: object) -> None:
        try:
            _write(message, self._requests)
        except (BrokenPipeError, ValueError) as error:  # ended by itself, or closed
            raise self._ended_error() from error

    def _ended_error(self) -> PerceptionError:
        return PerceptionError(
            "process of the LiDAR stages",
            expected="a process that runs until the pipeline is closed",
            found=f"a process that has ended with exit code {self._process.wait()}",
            advice="look for its message above, or pass --pipeline.no-parallel",
        )

    @property
    def _requests(self) -> IO[bytes]:
        return cast(IO[bytes], self._process.stdin)

    @property
    def _responses(self) -> IO[bytes]:
        return cast(IO[bytes], self._process.stdout)


def _write(message: object, stream: IO[bytes]) -> None:
    pickle.dump(message, stream, pickle.HIGHEST_PROTOCOL)
    stream.flush()


def _serve_requests(requests: IO[bytes], responses: IO[bytes]) -> None:
    """Answer one request after another, until there are no more."""
    stages = LidarStages(*pickle.load(requests))

    def step(frame: Frame, clock: StageClock) -> LidarResult:
        return replace(stages.step(frame, clock), scan=None)  # it repeats the points of the frame

    tasks: dict[str, Callable[..., object]] = {"step": step, "reset": stages.reset}
    while True:
        try:
            name, arguments = pickle.load(requests)
        except EOFError:
            return
        try:
            response = tasks[name](*arguments)
        except Exception as error:  # any error belongs to the caller
            response = error
        _write(response, responses)


def serve() -> None:
    """Run the other process."""
    # What is printed must not get into the responses.
    responses = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    limit_opencv_threads()
    with limit_blas_threads():
        try:
            _serve_requests(sys.stdin.buffer, responses)
        except BrokenPipeError:
            os._exit(0)  # no reader is left; what is buffered is not written
