"""The obstacle chain in a process of its own: Python lets only one thread of a process run at a time.

    this process    step(frame) -- frame without its image -->.
                                                              | obstacle chain
                    Surroundings <-- or an error -------------'  the other process

It begins with this module, so that no script that makes a pipeline is run a second time. It ends when it is
closed, and when this process ends, however that comes about.
"""

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, cast

from perception.errors import PerceptionError
from perception.geometry.threads import limit_blas_threads, limit_opencv_threads
from perception.pipeline.clock import StageClock
from perception.pipeline.config import PipelineConfig
from perception.pipeline.obstacle_chain import LidarResult, ObstacleChain
from perception.sensor import LidarModel
from perception.types import Frame


class ObstacleProcess:
    """Does what an `ObstacleChain` does, in another process; one thread at a time may ask it."""

    def __init__(self, sensor: LidarModel, config: PipelineConfig) -> None:
        """Start the process, and do not wait until it is ready.

        Args:
            sensor: whose scans will come.
            config: every choice.

        Raises:
            PerceptionError: no process can be started.
        """
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", f"from {__name__} import serve; serve()"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=_environment(),
            )
        except OSError as error:
            raise PerceptionError(
                f"process of {sys.executable or 'Python'}",
                expected="one that can be started for the obstacle stages",
                found=str(error),
                advice="set parallel to false in the configuration of the pipeline",
            ) from error
        self._send((sensor, config))

    @property
    def process_id(self) -> int:
        """By which the system knows it."""
        return self._process.pid

    def step(self, frame: Frame, clock: StageClock) -> LidarResult:
        """Return what the chain's `step` does; the clock has its stages then.

        Raises:
            PerceptionError: as for the chain's `step`, or the process has ended.
        """
        lidar_result, clock.spans = self._call("step", replace(frame, image=None), clock)
        return cast(LidarResult, lidar_result)

    def reset(self) -> None:
        """Forget the drive so far."""
        self._call("reset")

    def close(self) -> None:
        """End the process after what it does now."""
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
            "process of the obstacle stages",
            expected="one that runs until the pipeline is closed",
            found=f"one that has ended with exit code {self._process.wait()}",
            advice="look for its message above, or set parallel to false in the configuration of the pipeline",
        )

    @property
    def _requests(self) -> IO[bytes]:
        return cast(IO[bytes], self._process.stdin)

    @property
    def _responses(self) -> IO[bytes]:
        return cast(IO[bytes], self._process.stdout)


def _environment() -> Mapping[str, str]:
    """Return what lets the other process import what this one can."""
    paths = [str(Path(place).absolute()) for place in sys.path]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths)}


def _write(message: object, stream: IO[bytes]) -> None:
    pickle.dump(message, stream, pickle.HIGHEST_PROTOCOL)
    stream.flush()


def _serve_requests(requests: IO[bytes], responses: IO[bytes]) -> None:
    """Answer one question after another, until there are no more."""
    chain = ObstacleChain(*pickle.load(requests))

    def step(frame: Frame, clock: StageClock) -> object:
        return chain.step(frame, clock), clock.spans

    tasks: dict[str, Callable[..., object]] = {"step": step, "reset": chain.reset}
    while True:
        try:
            name, arguments = pickle.load(requests)
        except EOFError:
            return
        try:
            response = tasks[name](*arguments)
        except Exception as error:  # whatever it is, it is for the one who asks
            response = error
        _write(response, responses)


def serve() -> None:
    """Be the other process."""
    # An interrupt reaches both processes; it is the other one's to end this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Whatever prints shall not do so into the answers.
    responses = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    limit_opencv_threads()
    with limit_blas_threads():
        try:
            _serve_requests(sys.stdin.buffer, responses)
        except BrokenPipeError:
            os._exit(0)  # nobody is there to hear; what is buffered is not written
