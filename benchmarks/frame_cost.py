"""Cost of a frame by the pipeline, in processor time: by stage, and over a long run."""

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.measure import memory_mib, processor_clock
from benchmarks.pipeline import FrameSource
from perception.cli.progress import progress_bar
from perception.evaluation.stage_times import ALL_STAGES
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import LidarModel
from perception.types import Drive, Frame

WARM_UP = 8  # frames that fill the window of scans
_BLOCKS = 20  # of a long run


@dataclass(frozen=True)
class FrameCost:
    """Cost of a frame in one setting.

    Attributes:
        size: Number of points of a scan, or square metres of the area.
        stages_ms: Median processor time of each stage and of the whole frame in milliseconds.
    """

    size: float
    stages_ms: Mapping[str, float]

    @property
    def all_ms(self) -> float:
        """Median processor time of a frame in milliseconds."""
        return self.stages_ms[ALL_STAGES]


@dataclass(frozen=True)
class LongRun:
    """Blocks of a long run.

    Attributes:
        frames: Number of frames until the end of each block.
        medians_ms: Median processor time of a frame of each block in milliseconds.
        memory_mib: Memory at the end of each block in MiB.
    """

    frames: Sequence[int]
    medians_ms: Sequence[float]
    memory_mib: Sequence[float]


def long_run(drive: Drive, length: int, config: PipelineConfig) -> LongRun:
    """Run over a drive back and forth.

    Args:
        drive: Drive, of which the first frames are kept in memory.
        length: Number of frames of the run.
        config: Pipeline configuration.
    """
    with Pipeline(drive.sensor, config) as pipeline:
        frames = progress_bar(FrameSource(drive).take(length), "frames", length, delay_s=2)
        return blocks_of((_cpu_s(pipeline, frame) for frame in frames), length)


def blocks_of(frames_s: Iterable[float], length: int) -> LongRun:
    """Return the blocks of a long run.

    Args:
        frames_s: Processor time of each frame in seconds, as the frames run.
        length: Number of frames.
    """
    block = -(-length // _BLOCKS)
    ends, medians_ms, memories, times_s = [], [], [], []
    for number, frame_s in enumerate(frames_s, start=1):
        times_s.append(frame_s)
        if number % block == 0 or number == length:
            ends.append(number)
            medians_ms.append(1e3 * float(np.median(times_s)))
            memories.append(memory_mib())
            times_s.clear()
    return LongRun(ends, medians_ms, memories)


def median_stages_ms(
    sensor: LidarModel, frames: Sequence[Frame], config: PipelineConfig
) -> dict[str, float]:
    """Return the median processor time of each stage and of the whole frame, once the window of scans is full."""
    with processor_clock(), Pipeline(sensor, config) as pipeline:
        times = list(_stage_times(pipeline, frames))[WARM_UP:]
    stages = dict.fromkeys(stage for frame in times for stage in frame)
    return {
        stage: 1e3 * float(np.median([frame[stage] for frame in times if stage in frame]))
        for stage in stages
    }


def _stage_times(pipeline: Pipeline, frames: Iterable[Frame]) -> Iterator[dict[str, float]]:
    for frame in frames:
        start_s = time.process_time()
        timings_s = pipeline.step(frame).timings_s
        yield {**timings_s, ALL_STAGES: time.process_time() - start_s}


def _cpu_s(pipeline: Pipeline, frame: Frame) -> float:
    start_s = time.process_time()
    pipeline.step(frame)
    return time.process_time() - start_s
