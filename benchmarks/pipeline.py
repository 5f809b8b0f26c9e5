"""Whole runs, frame after frame: speed, latency, memory and stages of the obstacle chain and of the pipeline."""

import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import Annotated

import numpy as np

from benchmarks.measure import memory_mib
from perception.evaluation.report import Column, Metric, Metrics, Table
from perception.evaluation.stage_times import StageTime, StageTimes
from perception.pipeline import Pipeline, PipelineConfig
from perception.types import Drive, Frame, Result

# Frames kept in memory, so that reading is not measured: 16 s as they were driven. After them the drive is
# played backwards, where for some frames all objects move otherwise than before.
_KEPT = 160


@dataclass(frozen=True)
class RunTiming(Metrics):
    """Time and memory of one run.

    Attributes:
        frames: Number of measured frames.
        dropped: Number of frames that were dropped.
        skipped: Number of frames in which a stage was left out to keep the time budget.
        frames_per_s: Results per second.
        median_ms: Median time from the arrival of a frame to its result in milliseconds.
        p99_ms: 99th percentile of the same time in milliseconds.
        stages: Median and 99th percentile of each stage and of all together in milliseconds.
        memory_start_mib: Memory after the first fifth of the frames in MiB.
        memory_end_mib: Memory after the last frame in MiB.
    """

    frames: Annotated[int, Metric("frames")]
    dropped: Annotated[int, Metric("dropped")]
    skipped: Annotated[int, Metric("skipped")]
    frames_per_s: Annotated[float, Metric("frames/s", ".1f")]
    median_ms: Annotated[float, Metric("p50 [ms]", ".1f")]
    p99_ms: Annotated[float, Metric("p99 [ms]", ".1f")]
    stages: Mapping[str, StageTime]
    memory_start_mib: Annotated[float, Metric("start [MiB]", ".0f")]
    memory_end_mib: Annotated[float, Metric("end [MiB]", ".0f")]


def measure_chain(drive: Drive, frames: int) -> dict[str, RunTiming]:
    """Run the obstacle chain by the default and the thesis' methods, once its window of scans is full."""
    given = FrameSource(drive)
    runs: dict[str, RunTiming] = {}
    thesis = replace(PipelineConfig.for_motion("thesis"), method="thesis")
    # The thesis' methods are thirty times slower: a tenth of the frames is enough.
    for config, count in ((PipelineConfig.for_motion(), frames), (thesis, max(frames // 10, 10))):
        results = map(Pipeline(drive.sensor, config).step, given.take(count))
        warm_up = min(config.motion.previous_scans, count - 1)
        deque(islice(results, warm_up), maxlen=0)
        runs[config.method] = _measure(results, count - warm_up)
    return runs


def measure_pipeline(drive: Drive, frames: int, config: PipelineConfig) -> dict[str, RunTiming]:
    """Run the pipeline over a number of frames of a drive: sequential, parallel, and at the sensor's rate."""
    given, rate_hz = FrameSource(drive), drive.sensor.rate_hz
    runs: dict[str, RunTiming] = {}
    with Pipeline(drive.sensor, replace(config, parallel=False)) as pipeline:
        runs["sequential"] = _measure(map(pipeline.step, given.take(frames)), frames)
    with Pipeline(drive.sensor, config) as pipeline:
        runs["parallel"] = _measure(map(pipeline.step, given.take(frames)), frames)
        pipeline.reset()
        arriving = _at_rate(given.take(frames), rate_hz)
        with pipeline.stream(arriving, "latest") as results:
            latest = _measure(results, frames)
            name = f"at {rate_hz:.0f} Hz, the latest frame"
            runs[name] = replace(latest, dropped=results.dropped)
    return runs


def run_tables(title: str, runs: Mapping[str, RunTiming], first: str) -> str:
    """Return speed, latency and memory of each run, and the times of its stages.

    Args:
        title: Title of the first table.
        runs: Runs by name.
        first: Name of the run to which the times are relative.
    """
    first_ms = runs[first].median_ms
    relative = Column[RunTiming]("relative time", lambda run: run.median_ms / first_ms, ".1f")
    stages = {stage: stage for run in runs.values() for stage in run.stages}
    times = [
        Column[str](f"{name} {heading} [ms]", partial(_stage_ms, run, heading), ".1f")
        for name, run in runs.items()
        for heading in ("p50", "p99")
    ]
    columns = [*RunTiming.columns(), relative]
    tables = Table(title, columns, runs), Table("stages", times, stages, "stage")
    return "\n\n".join(table.text() for table in tables)


def _stage_ms(run: RunTiming, heading: str, stage: str) -> float | None:
    if stage not in run.stages:
        return None
    times = run.stages[stage]
    return times.p50_ms if heading == "p50" else times.p99_ms


class FrameSource:
    """Frames of a drive in memory, played to the end and back again, with time going forward."""

    def __init__(self, drive: Drive) -> None:
        """Read the frames that are kept."""
        self._kept: Sequence[Frame] = [drive[index] for index in range(min(len(drive), _KEPT))]
        self._period_s = 1 / drive.sensor.rate_hz

    def take(self, frames: int) -> Iterator[Frame]:
        """Yield a number of frames."""
        last = len(self._kept) - 1
        for number in range(frames):
            phase = number % (2 * last) if last else 0
            index = phase if phase <= last else 2 * last - phase
            yield replace(self._kept[index], index=number, stamp_s=number * self._period_s)


def _at_rate(frames: Iterable[Frame], rate_hz: float) -> Iterator[Frame]:
    """Yield frames at a rate, late ones at once."""
    start_s = time.perf_counter()
    for number, frame in enumerate(frames):
        time.sleep(max(start_s + number / rate_hz - time.perf_counter(), 0.0))
        yield frame


def _measure(results: Iterable[Result], frames: int) -> RunTiming:
    times, latencies_s, skipped, start_s = StageTimes(), [], 0, time.perf_counter()
    memory_start = memory_mib()
    for number, result in enumerate(results):
        times.update(result)
        latencies_s.append(result.latency_s)
        skipped += bool(result.skipped)
        if number == frames // 5:
            memory_start = memory_mib()
    elapsed_s = time.perf_counter() - start_s
    return RunTiming(
        frames=frames,
        dropped=0,
        skipped=skipped,
        frames_per_s=len(times) / elapsed_s,
        median_ms=1e3 * float(np.median(latencies_s)),
        p99_ms=1e3 * float(np.percentile(latencies_s, 99)),
        stages=times.table("").rows,
        memory_start_mib=memory_start,
        memory_end_mib=memory_mib(),
    )
