"""Threads of the numeric libraries: few, and none that spins while it waits."""

import os
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


def set_passive_openmp_wait() -> None:
    """Keep waiting OpenMP threads from spinning; call it before OpenMP is loaded.

    Measured beside a busy process with small_gicp: 22 ms a registration instead of 70.
    """
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def limit_opencv_threads() -> None:
    """Limit OpenCV to one thread, for stages that run side by side.

    Measured with two stages at a time on two cores: 87 ms a frame instead of 103, and a sixth less processor time.
    """
    import cv2

    cv2.setNumThreads(1)


@contextmanager
def limit_blas_threads() -> Iterator[None]:
    """Limit BLAS to one thread: on small arrays, more threads cost time.

    The number of threads is one of the whole process, so the limit holds until the last caller has left.
    """
    _LIMIT.enter()
    try:
        yield
    finally:
        _LIMIT.leave()


def find_blas() -> None:
    """Find the BLAS libraries that are loaded by now; else the first limit does, in 6 to 15 ms."""
    _thread_pools()


class _SharedLimit:
    """The limit that is shared by all threads of this process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._holders = 0
        self._limit = ExitStack()

    def enter(self) -> None:
        with self._lock:
            if not self._holders:
                self._limit.enter_context(_thread_pools().limit(limits=1, user_api="blas"))
            self._holders += 1

    def leave(self) -> None:
        with self._lock:
            self._holders -= 1
            if not self._holders:
                self._limit.close()


_LIMIT = _SharedLimit()


@cache
def _thread_pools() -> "ThreadpoolController":
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
