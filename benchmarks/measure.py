"""Timing that can be compared: contenders take turns on the same input, in one process."""

import logging
import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from perception.errors import MissingDependencyError, ModelError
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
        outputs: What it returned for each input, where a metric asks for it.
    """

    name: str
    seconds: list[float] = field(default_factory=list)
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
            start = time.perf_counter()
            output = contender.run(i)
            row.seconds.append(time.perf_counter() - start)
            if metrics:
                row.outputs.append(output)
    first_s = rows[contenders[0].name].seconds
    times = (
        Column[Measurement]("p50 [ms]", lambda row: _percentile_ms(row, 50), ".1f", "p50_ms"),
        Column[Measurement]("p99 [ms]", lambda row: _percentile_ms(row, 99), ".1f", "p99_ms"),
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


def add_peer(contenders: list[Contender], make: Callable[[], Contender]) -> None:
    """Add a peer, or log why it is not measured."""
    try:
        contenders.append(make())
    except (MissingDependencyError, ModelError) as error:
        log.warning("not measured: %s", error)


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


def _percentile_ms(row: Measurement, percent: float) -> float:
    return 1e3 * float(np.percentile(row.seconds, percent))
