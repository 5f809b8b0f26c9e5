"""Timing that can be compared: contenders take turns on the same input, in one process."""

import logging
import resource
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from perception.errors import MissingDependencyError, ModelError
from perception.evaluation.confusion import Confusion
from perception.evaluation.report import Column, Table, Value

log = logging.getLogger(__name__)


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
class Measurement:
    """Times and outputs of one contender.

    Attributes:
        name: Name of the contender.
        seconds: Time of each input in seconds.
        cpu_seconds: Processor time of all threads for each input in seconds.
        outputs: What it returned for each input, where a metric asks for it.
    """

    name: str
    seconds: list[float] = field(default_factory=list)
    cpu_seconds: list[float] = field(default_factory=list)
    outputs: list[Any] = field(default_factory=list)


Comparison = Table[Measurement]


def compare(
    title: str, contenders: Sequence[Contender], inputs: int, *metrics: Column[Measurement]
) -> Comparison:
    """Run every contender on every input, one after the other, so that drift hits all alike.

    Args:
        title: Title of the table.
        contenders: Contenders; the times of the others are relative to those of the first.
        inputs: Number of inputs; the first is run once before, unmeasured.
        metrics: Further columns of the table.
    """
    for contender in contenders:
        contender.run(0)
    rows = {contender.name: Measurement(contender.name) for contender in contenders}
    for i in range(inputs):
        for contender, row in zip(contenders, rows.values(), strict=True):
            start_s, start_cpu_s = time.perf_counter(), time.process_time()
            output = contender.run(i)
            row.cpu_seconds.append(time.process_time() - start_cpu_s)
            row.seconds.append(time.perf_counter() - start_s)
            if metrics:
                row.outputs.append(output)
    first_s = rows[contenders[0].name].seconds
    times = (
        _time_column("p50 [ms]", "p50_ms", lambda row: _percentile_ms(row.seconds, 50)),
        _time_column("p99 [ms]", "p99_ms", lambda row: _percentile_ms(row.seconds, 99)),
        _time_column("CPU p50 [ms]", "cpu_ms", lambda row: _percentile_ms(row.cpu_seconds, 50)),
        Column[Measurement](
            "relative time",
            lambda row: float(np.median(np.divide(row.seconds, first_s))),
            ".1f",
            "relative_time",
        ),
    )
    return Table(title, (*times, *metrics), rows)


def metric(heading: str, value: Callable[[list[Any]], Value], spec: str) -> Column[Measurement]:
    """Return a column with a value of each contender's outputs.

    Args:
        heading: Heading with unit, also its key in the JSON document.
        value: Returns the value of all outputs of a contender; None where it is unknown.
        spec: Format specification of the value in the table.
    """
    return Column(heading, lambda row: value(row.outputs), spec, heading)


def confusion_columns(count: Callable[[list[Any]], Confusion]) -> list[Column[Measurement]]:
    """Return the columns of a classification of points.

    Args:
        count: Returns the counts of all outputs of a contender.
    """
    counts: dict[str, Confusion] = {}

    def value(of_counts: Column[Confusion], row: Measurement) -> Value:
        if row.name not in counts:
            counts[row.name] = count(row.outputs)
        return of_counts.value(counts[row.name])

    return [
        Column(column.name, partial(value, column), column.spec, column.key)
        for column in Confusion.columns()
        if column.key != "true_points"
    ]


def add_peer(contenders: list[Contender], make: Callable[[], Contender]) -> None:
    """Add a peer, or log why it is not measured."""
    try:
        contenders.append(make())
    except (MissingDependencyError, ModelError) as error:
        log.warning("not measured: %s", error)


def memory_mib() -> float:
    """Return the memory that this process and those that it started hold now, in MiB: shared pages count once.

    Elsewhere than on Linux: the peak of this process alone.
    """
    try:
        here = Path("/proc/self")
        started = " ".join(file.read_text() for file in here.glob("task/*/children")).split()
        processes = (here, *(Path("/proc", number) for number in started))
        return sum(_proportional_kib(process) for process in processes) / 2**10
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10


def _proportional_kib(process: Path) -> int:
    """Return the proportional set size of a process, in which a page of k processes counts 1/k."""
    lines = (process / "smaps_rollup").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Pss:"))


@contextmanager
def processor_clock() -> Iterator[None]:
    """Let stages be measured in the processor time of all threads, which other programs hardly change."""
    wall_clock, time.perf_counter = time.perf_counter, time.process_time
    try:
        yield
    finally:
        time.perf_counter = wall_clock


def _time_column(
    heading: str, name: str, value: Callable[[Measurement], float]
) -> Column[Measurement]:
    return Column(heading, value, ".1f", name)


def _percentile_ms(seconds: Sequence[float], percent: float) -> float:
    return 1e3 * float(np.percentile(seconds, percent))
