"""An object in a process of its own: Python lets only one thread of a process run at a time.

    this process    call(function, *arguments) -- pickled -->.
                                                             | function(object, *arguments)
                    what it returns, or its error <----------'  the other process

The other process starts with this module, so that a script that makes such an object is not run a second time. It
ends when it is closed, and when this process ends, for whatever reason.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import IO, Concatenate, Generic, ParamSpec, TypeVar, cast

from perception.errors import PerceptionError
from perception.geometry.threads import limit_blas_threads, limit_opencv_threads

Object = TypeVar("Object")
Params = ParamSpec("Params")
Returned = TypeVar("Returned")

# The other process finds modules where this one does. `python -P -c` does not put the working folder first, which may
# hold a user's random.py. What stops this process may reach both, from the start; this one ends the other.
_START = (
    "import signal, sys; signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM}); sys.path[:] = sys.argv[1:]; "
    f"from {__name__} import serve; serve()"
)


class RemoteObject(Generic[Object]):
    """An object in another process; one thread at a time may call it."""

    def __init__(self, name: str, make: Callable[[], Object], advice: str) -> None:
        """Start the process; it makes the object in the background.

        Args:
            name: What the object is, for errors.
            make: Function that makes the object; a module's function, or a partial of one.
            advice: What to do without a process.

        Raises:
            PerceptionError: no process can be started.
        """
        self._name, self._advice = name, advice
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _START, *map(os.path.abspath, sys.path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
        except OSError as error:
            raise PerceptionError(
                f"process of {sys.executable or 'Python'}",
                expected=f"a process that can be started for {name}",
                found=str(error),
                advice=advice,
            ) from error
        self._send(make)

    @property
    def process_id(self) -> int:
        """Process id."""
        return self._process.pid

    def call(
        self,
        function: Callable[Concatenate[Object, Params], Returned],
        *args: Params.args,
        **kwargs: Params.kwargs,
    ) -> Returned:
        """Call a function or a method of a module with the object and arguments.

        Raises:
            PerceptionError: the error of the function, or the process has ended.
        """
        self._send((function, args, kwargs))
        try:
            response = pickle.load(self._responses)
        except (EOFError, pickle.UnpicklingError) as error:
            raise self._ended_error() from error
        if isinstance(response, Exception):
            raise response
        return cast(Returned, response)

    def close(self) -> None:
        """End the process after the running call."""
        with suppress(BrokenPipeError):  # it has ended by itself
            self._requests.close()
        self._responses.close()
        self._process.wait()

    def _send(self, message: object) -> None:
        try:
            _write(message, self._requests)
        except (BrokenPipeError, ValueError) as error:  # ended by itself, or closed
            raise self._ended_error() from error

    def _ended_error(self) -> PerceptionError:
        return PerceptionError(
            f"process of {self._name}",
            expected="a process that runs until it is closed",
            found=f"a process that has ended with exit code {self._process.wait()}",
            advice=f"look for its message above, or {self._advice}",
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


def _serve_requests(remote: object, requests: IO[bytes], responses: IO[bytes]) -> None:
    """Answer one request after another, until there are no more."""
    while True:
        try:
            function, args, kwargs = pickle.load(requests)
        except EOFError:
            return
        try:
            response = function(remote, *args, **kwargs)
        except Exception as error:  # any error belongs to the caller
            response = error
        _write(response, responses)


def serve() -> None:
    """Run the other process."""
    # What is printed must not get into the responses.
    responses = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    # Making the object loads the libraries whose threads are limited.
    remote = pickle.load(sys.stdin.buffer)()
    limit_opencv_threads()
    with limit_blas_threads():
        try:
            _serve_requests(remote, sys.stdin.buffer, responses)
        except BrokenPipeError:
            os._exit(0)  # no reader is left; what is buffered is not written
