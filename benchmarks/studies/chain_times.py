"""Times of the stages of the obstacle chain by either method, on the same frames."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from perception.cli.progress import progress_bar
from perception.errors import DriveError, UsageError
from perception.pipeline import PipelineConfig
from perception.types import Drive, Method

# Table 7.3, by the stages of the pipeline: (a) dense cloud, (b) ground, (c) separation and voxels, (d) segmentation.
PUBLISHED_PERCENT = {
    "registration": 83.2,
    "ground": 7.1,
    "voxels": 7.7,
    "static and moving": 2.0,
}
PUBLISHED_FRAMES_PER_S = 0.3
"""Speed of the thesis' implementation in MATLAB with the values of Table 7.1: m = 6, υ = 10 cm."""

Times = Mapping[str, float]


def chain_config(method: Method, previous_scans: int, voxel_size_m: float = 0.1) -> PipelineConfig:
    """Return the configuration of the obstacle chain.

    Args:
        method: Method of all stages.
        previous_scans: Number m of scans before the newest in the window.
        voxel_size_m: Edge υ of a voxel in metres.
    """
    config = PipelineConfig.for_obstacles(method, previous_scans)
    return replace(config, motion=replace(config.motion, voxel_size_m=voxel_size_m))


def stage_times(drive: Drive, config: PipelineConfig, first: int, frames: int) -> Sequence[Times]:
    """Return the seconds by stage of a number of frames; the scans before them fill the window, unmeasured.

    The stages are those of Table 7.3; the monitors of the sensors, of which the thesis has none, are left out.

    Args:
        drive: Drive with INS.
        config: Pipeline configuration.
        first: Number of the first measured frame.
        frames: Number of measured frames.

    Raises:
        UsageError: The drive is too short.
        DriveError: The drive has no INS.
    """
    from perception.pipeline import Pipeline

    if len(drive) < first + frames:
        raise UsageError(
            f"--frames {frames}",
            expected=f"at most {len(drive) - first}, as {drive.name} has {len(drive)} frames "
            f"and the first {first} fill the window",
            found=str(frames),
        )
    if drive[first].world_SE3_velo is None:
        raise DriveError(drive.root, expected="INS poses to begin the ICP with", found="none")
    pipeline, warm_up = Pipeline(drive.sensor, config), config.motion.previous_scans
    indices = progress_bar(range(first - warm_up, first + frames), "frames", delay_s=2)
    times = [pipeline.step(drive[index]).timings_s for index in indices][warm_up:]
    return [{stage: frame[stage] for stage in PUBLISHED_PERCENT} for frame in times]


def mean_times_s(times: Sequence[Times]) -> dict[str, float]:
    """Return the mean of each stage over the frames."""
    return {stage: float(np.mean([frame[stage] for frame in times])) for stage in times[0]}


def frames_per_s(times: Sequence[Times]) -> float:
    """Return the frames per second that the stages allow, one after another."""
    return float(1 / np.mean([sum(frame.values()) for frame in times]))
