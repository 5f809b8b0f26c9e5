"""What a worker loads at its start: it keeps to one core, so that workers do not wait for each other."""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

import cv2

if TYPE_CHECKING:
    from distributed import Worker


# The name of a worker is its number on the machine, or ends with it: 3, node7-3. Others are those of addresses, such as
# tcp://10.0.0.5:40123.
_NUMBER = re.compile(r"(?:^|-)(\d+)$")


def dask_setup(worker: "Worker") -> None:
    """Use one thread for images, and bind the process to the core of the worker's number.

    The threads that it starts from now on are bound as well. A worker without a number is left where it is: a pod sees
    the cores of its whole machine, on which all pods would choose the same.

    Args:
        worker: Worker of a local cluster, or one that preloads this module.
    """
    cv2.setNumThreads(1)
    number = _NUMBER.search(str(worker.name))
    if number is not None and hasattr(os, "sched_setaffinity"):  # Linux
        cores = sorted(os.sched_getaffinity(0))
        core = cores[int(number[1]) % len(cores)]
        for thread in Path("/proc/self/task").iterdir():
            os.sched_setaffinity(int(thread.name), {core})
