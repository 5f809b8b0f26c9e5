"""What a worker of this machine loads at its start: it keeps to one core, so that workers do not wait for each other."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import cv2

if TYPE_CHECKING:
    from distributed import Worker


def dask_setup(worker: "Worker") -> None:
    """Bind this process, with all threads that it starts from now on, to the core of the worker's number.

    Args:
        worker: Worker of a local cluster, whose name is its number.
    """
    cv2.setNumThreads(1)
    if hasattr(os, "sched_setaffinity"):  # Linux
        cores = sorted(os.sched_getaffinity(0))
        core = cores[int(worker.name) % len(cores)]
        for thread in Path("/proc/self/task").iterdir():
            os.sched_setaffinity(int(thread.name), {core})
