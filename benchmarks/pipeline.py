"""The whole pipeline: sequential, parallel, and at the frame rate of a LiDAR; and its memory."""

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.chain import back_and_forth
from benchmarks.measure import resident_mib
from perception.evaluation.report import format_table
from perception.evaluation.stage_times import StageTime, StageTimes
from perception.pipeline import Pipeline, PipelineConfig
from perception.types import Drive, Frame, Result

# Frames kept in memory, so that reading is not measured: 16 s as they were driven. After them the drive is
# played backwards, where for some frames all objects move otherwise than before.
_KEPT = 160


@dataclass(frozen=True)
class PipelineTiming:
    """Time and memory of the pipeline for one way of giving it frames.

    Attributes:
        frames: Number of frames that arrived.
        dropped: Number of frames that were dropped.
        frames_per_s: Results per second.
        median_ms: Median time from the arrival of a frame to its result in milliseconds.
        p99_ms: 99th percentile of the same time in milliseconds.
        stages: Median and 99th percentile of each stage and of all together in milliseconds.
        memory_start_mib: Memory after the first fifth of the frames in MiB.
        memory_end_mib: Memory after the last frame in MiB.
    """

    frames: int
    dropped: int
    frames_per_s: float
    median_ms: float
    p99_ms: float
    stages: Mapping[str, StageTime]
    memory_start_mib: float
    memory_end_mib: float


def measure_pipeline(
    drive: Drive, frames: int, config: PipelineConfig
) -> dict[str, PipelineTiming]:
    """Run the pipeline over a number of frames of a drive: sequential, parallel, and at the sensor's rate."""
    kept = [drive[index] for index in range(min(len(drive), _KEPT))]
    turn_s = 1 / drive.sensor.rate_hz
    timings: dict[str, PipelineTiming] = {}
    with Pipeline(drive.sensor, replace(config, parallel=False)) as pipeline:
        given = back_and_forth(kept, frames, turn_s)
        timings["sequential"] = _measure(map(pipeline.step, given), frames)
    with Pipeline(drive.sensor, config) as pipeline:
        given = back_and_forth(kept, frames, turn_s)
        timings["parallel"] = _measure(map(pipeline.step, given), frames)
        pipeline.reset()
        given = back_and_forth(kept, frames, turn_s)
        with pipeline.stream(_at_sensor_rate(given, turn_s), "latest") as results:
            name = f"at {drive.sensor.rate_hz:.0f} Hz, the latest frame"
            timings[name] = replace(_measure(results, frames), dropped=results.dropped)
    return timings


def pipeline_table(timings: Mapping[str, PipelineTiming]) -> str:
    """Return speed, latency and memory of each way, and the time of each stage."""
    rows = [
        [
            name,
            str(timing.frames),
            str(timing.dropped),
            f"{timing.frames_per_s:.1f}",
            f"{timing.median_ms:.1f}",
            f"{timing.p99_ms:.1f}",
            f"{timing.memory_start_mib:.0f} to {timing.memory_end_mib:.0f}",
        ]
        for name, timing in timings.items()
    ]
    header = ("", "frames", "dropped", "results/s", "p50 [ms]", "p99 [ms]", "memory [MiB]")
    alone, beside = list(timings.values())[:2]
    stages = [
        [
            stage,
            *(f"{ms:.1f}" for of in (alone, beside) for ms in _p50_p99(of.stages[stage])),
        ]
        for stage in alone.stages
    ]
    head = ("stage", "p50 [ms]", "p99 [ms]", "parallel p50 [ms]", "parallel p99 [ms]")
    return "\n\n".join(
        [
            format_table("end to end", header, rows),
            format_table("stages, sequential and parallel", head, stages),
        ]
    )


def _at_sensor_rate(frames: Iterable[Frame], turn_s: float) -> Iterator[Frame]:
    """Yield a frame at the rate of the LiDAR, late ones at once."""
    start_s = time.perf_counter()
    for number, frame in enumerate(frames):
        time.sleep(max(start_s + number * turn_s - time.perf_counter(), 0.0))
        yield frame


def _p50_p99(time: StageTime) -> tuple[float, float]:
    return time.p50_ms, time.p99_ms


def _measure(results: Iterable[Result], frames: int) -> PipelineTiming:
    times, latencies_s, start_s = StageTimes(), [], time.perf_counter()
    memory_start = resident_mib()
    for number, result in enumerate(results):
        times.update(result)
        latencies_s.append(result.latency_s)
        if number == frames // 5:
            memory_start = resident_mib()
    elapsed_s = time.perf_counter() - start_s
    return PipelineTiming(
        frames=frames,
        dropped=0,
        frames_per_s=len(times.spans) / elapsed_s,
        median_ms=1e3 * float(np.median(latencies_s)),
        p99_ms=1e3 * float(np.percentile(latencies_s, 99)),
        stages=times.table("").rows,
        memory_start_mib=memory_start,
        memory_end_mib=resident_mib(),
    )
