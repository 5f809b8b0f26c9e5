"""Commands in processes that are killed at a given moment, and go on."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

# What the interpreter tells of itself, and ends up in files: opened, renamed, removed, cut off.
_MOMENTS = ("open", "os.rename", "os.remove", "os.truncate")


def run_command(words: Sequence[str], killed_at: int = 0, delay_s: float = 0.0) -> int:
    """Run a command in a process of its own; return its exit code, -9 where it was killed.

    Args:
        words: Words of the command line.
        killed_at: Number of the file operation at which it is killed (SIGKILL); 0 for never.
        delay_s: Time from that operation to the kill, so that it comes in the midst of others.
    """
    process = multiprocessing.get_context("fork").Process(
        target=_run, args=([*map(str, words)], killed_at, delay_s)
    )
    process.start()
    process.join()
    assert process.exitcode is not None
    return process.exitcode


def _run(words: Sequence[str], killed_at: int, delay_s: float) -> None:
    from perception.cli.main import main
    from perception.detection.detectors import multimodal
    from perception.pipeline.workers import StageClock

    # Times of stages are drawn and written: with clocks that count, all files are comparable.
    StageClock.elapsed_s = property(_count_ms)
    multimodal.time = SimpleNamespace(perf_counter=lambda: 0.0)
    with Path(os.devnull).open("w") as nothing:
        os.dup2(nothing.fileno(), 2)
        os.dup2(nothing.fileno(), 1)
    if killed_at:
        sys.addaudithook(_Killer(killed_at, delay_s))
    sys.exit(main(words))


def _count_ms(clock: object) -> float:
    """Return 1 ms more at each reading of a clock."""
    vars(clock)["readings"] = readings = vars(clock).get("readings", 0) + 1
    return 1e-3 * readings


class _Killer:
    """An audit hook that ends its process at the n-th operation on a file that is written."""

    def __init__(self, moment: int, delay_s: float) -> None:
        self._left, self._delay_s = moment, delay_s

    def __call__(self, event: str, arguments: tuple[object, ...]) -> None:
        if event not in _MOMENTS or (event == "open" and not _writes(arguments)):
            return
        self._left -= 1
        if self._left == 0:
            if self._delay_s:
                threading.Timer(self._delay_s, _kill).start()
            else:
                _kill()


def _writes(arguments: tuple[object, ...]) -> bool:
    flags = arguments[2]
    return isinstance(flags, int) and bool(flags & (os.O_WRONLY | os.O_RDWR))


def _kill() -> None:
    os.kill(os.getpid(), signal.SIGKILL)
