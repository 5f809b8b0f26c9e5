"""Independent parts of one task, spread over processes."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from threading import Thread
from typing import TypeVar

import cv2
from threadpoolctl import threadpool_limits

from perception.errors import PerceptionError, UsageError

Part = TypeVar("Part")
Done = TypeVar("Done")


def run_parts(
    work: Callable[[Part], Done], parts: Sequence[Part], workers: int
) -> Iterator[tuple[Part, Done]]:
    """Yield each part with what was made of it, in the order in which they are done.

    Every process keeps to one thread, so that as many processes as cores do not wait for one another.

    Args:
        work: Function of a module, which other processes can import.
        parts: Arguments of each call.
        workers: Number of processes; 1 runs in this process.

    Raises:
        PerceptionError: the work raised it, or a process was ended from outside.
    """
    if workers < 1:
        raise UsageError("--workers", expected="at least 1", found=str(workers))
    if workers == 1 or len(parts) < 2:
        with threadpool_limits(limits=1):
            yield from ((part, work(part)) for part in parts)
        return
    yield from _run_in_processes(work, parts, min(workers, len(parts)))


def _run_in_processes(
    work: Callable[[Part], Done], parts: Sequence[Part], workers: int
) -> Iterator[tuple[Part, Done]]:
    # Processes that start afresh inherit no locks of threads that run here.
    pool = ProcessPoolExecutor(
        workers, multiprocessing.get_context("spawn"), initializer=_init_worker
    )
    try:
        part_of = {pool.submit(work, part): part for part in parts}
        for future in as_completed(part_of):
            yield part_of[future], future.result()
    except BrokenProcessPool as error:
        raise PerceptionError(
            f"{workers} worker processes",
            expected="all to go on",
            found="one that was ended from outside, most often for want of memory",
            advice="repeat the command with fewer --workers; what is done is kept",
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


def _init_worker() -> None:
    """Keep to one thread, leave Ctrl-C to the parent, and end with it however it ends."""
    os.environ.update(OMP_NUM_THREADS="1", NUMBA_NUM_THREADS="1")  # of libraries not loaded yet
    threadpool_limits(limits=1)
    cv2.setNumThreads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
