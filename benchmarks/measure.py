"""Timing that can be compared: contenders take turns on the same input, in one process."""

import resource
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from perception.evaluation.report import format_table

Cell = str | None


@dataclass(frozen=True)
class Contender:
    """One way of doing a stage.

    Attributes:
        name: Name in the table.
        run: Function that does the work once on input number i.
    """

    name: str
    run: Callable[[int], Any]


@dataclass(frozen=True)
class Timing:
    """How long one contender takes.

    Attributes:
        name: Name of the contender.
        median_ms: Median time over all inputs in milliseconds.
        p99_ms: 99th percentile of the time in milliseconds.
        ratio: Median over the inputs of its time relative to that of the first contender on the same input.
    """

    name: str
    median_ms: float
    p99_ms: float
    ratio: float


def time_interleaved(
    contenders: Sequence[Contender],
    inputs: int,
    observe: Callable[[str, int, Any], None] = lambda name, i, output: None,
) -> list[Timing]:
    """Run every contender on every input, one after the other, so that drift hits all alike.

    Args:
        contenders: Contenders; the others are compared with the first.
        inputs: Number of inputs; the first is run once before, unmeasured.
        observe: Function called with name, input and output of each run, outside the measured time.
    """
    for contender in contenders:
        contender.run(0)
    seconds = np.empty((inputs, len(contenders)))
    for i in range(inputs):
        for column, contender in enumerate(contenders):
            start = time.perf_counter()
            output = contender.run(i)
            seconds[i, column] = time.perf_counter() - start
            observe(contender.name, i, output)
    return [
        Timing(
            contender.name,
            median_ms=1e3 * float(np.median(seconds[:, column])),
            p99_ms=1e3 * float(np.percentile(seconds[:, column], 99)),
            ratio=float(np.median(seconds[:, column] / seconds[:, 0])),
        )
        for column, contender in enumerate(contenders)
    ]


def timing_table(title: str, timings: Sequence[Timing], **columns: Mapping[str, Cell]) -> str:
    """Return a table of timings, with further columns that map a contender's name to a figure."""
    names = [name.replace("_", " ") for name in columns]
    rows = [
        [
            t.name,
            f"{t.median_ms:.1f}",
            f"{t.p99_ms:.1f}",
            f"{t.ratio:.1f}",
            *(column.get(t.name) or "-" for column in columns.values()),
        ]
        for t in timings
    ]
    return format_table(title, ("", "p50 [ms]", "p99 [ms]", "relative time", *names), rows)


def resident_mib() -> float:
    """Return the memory that this process and those that it started hold now, in MiB.

    What they share counts for each of them. Elsewhere than on Linux: the peak of this process alone.
    """
    try:
        here = Path("/proc/self")
        started = " ".join(file.read_text() for file in here.glob("task/*/children")).split()
        statms = [process / "statm" for process in (here, *(Path("/proc", pid) for pid in started))]
        pages = sum(int(statm.read_text().split()[1]) for statm in statms)
        return pages * resource.getpagesize() / 2**20
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10
