"""The whole chain, frame after frame: speed, its worst frames, and memory."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.measure import resident_mib
from perception.evaluation.report import Column, Table
from perception.pipeline import Pipeline, PipelineConfig
from perception.types import Drive, Frame


@dataclass(frozen=True)
class ChainMetrics:
    """What one run of the chain took.

    Attributes:
        frames: Number of measured frames, after the window was full.
        frames_per_s: Frames per second by the mean time of all stages, without reading.
        median_ms: Median time of all stages in milliseconds.
        p99_ms: 99th percentile of the time of all stages in milliseconds.
        stages_ms: Median time of each stage in milliseconds.
        memory_start_mib: Memory after the first fifth of the frames in MiB.
        memory_end_mib: Memory after the last frame in MiB.
    """

    frames: int
    frames_per_s: float
    median_ms: float
    p99_ms: float
    stages_ms: dict[str, float]
    memory_start_mib: float
    memory_end_mib: float


def back_and_forth(
    drive: Drive | Sequence[Frame], frames: int, turn_s: float = 0.1
) -> Iterator[Frame]:
    """Yield a number of frames by driving to the end and back again, with time going forward."""
    last = len(drive) - 1
    for number in range(frames):
        phase = number % (2 * last) if last else 0
        index = phase if phase <= last else 2 * last - phase
        yield replace(drive[index], index=number, stamp_s=number * turn_s)


def measure_chain(drive: Drive, frames: int, config: PipelineConfig) -> ChainMetrics:
    """Run the chain over a number of frames of a drive."""
    pipeline = Pipeline(drive.sensor, config)
    times: list[dict[str, float]] = []
    memory_start = resident_mib()
    for number, frame in enumerate(back_and_forth(drive, frames, 1 / drive.sensor.rate_hz)):
        times.append(pipeline.step(frame).timings_s)
        if number == frames // 5:
            memory_start = resident_mib()
    measured = times[min(config.motion.previous_scans, frames - 1) :]
    total = np.array([sum(stages.values()) for stages in measured])
    return ChainMetrics(
        frames=len(measured),
        frames_per_s=float(1 / total.mean()),
        median_ms=1e3 * float(np.median(total)),
        p99_ms=1e3 * float(np.percentile(total, 99)),
        stages_ms={
            name: 1e3 * float(np.median([stages[name] for stages in measured]))
            for name in measured[0]
        },
        memory_start_mib=memory_start,
        memory_end_mib=resident_mib(),
    )


def chain_table(metrics: Mapping[str, ChainMetrics]) -> str:
    """Return speed and memory of the chain by method."""
    default = metrics["default"]
    columns = (
        Column[ChainMetrics]("frames", lambda row: row.frames),
        Column[ChainMetrics]("frames/s", lambda row: row.frames_per_s, ".1f"),
        Column[ChainMetrics]("p50 [ms]", lambda row: row.median_ms, ".1f"),
        Column[ChainMetrics]("p99 [ms]", lambda row: row.p99_ms, ".1f"),
        Column[ChainMetrics]("relative time", lambda row: row.median_ms / default.median_ms, ".1f"),
        Column[ChainMetrics]("start [MiB]", lambda row: row.memory_start_mib, ".0f"),
        Column[ChainMetrics]("end [MiB]", lambda row: row.memory_end_mib, ".0f"),
    )
    notes = [
        f"p50 of the stages of {method} [ms]: "
        + ", ".join(f"{name} {ms:.1f}" for name, ms in row.stages_ms.items())
        for method, row in metrics.items()
    ]
    title = "whole chain (the thesis reports 0.3 frames/s)"
    return Table(title, columns, metrics, heading="method", notes=notes).text()
