"""Share of the time of each stage (Table 7.3): as published, repeated, and by the default method."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.studies.report import RESULTS, DriveOfStudy, formatted_table, publish
from perception.cli.flags import require_positive
from perception.cli.progress import progress_bar
from perception.errors import DriveError, UsageError
from perception.pipeline import PipelineConfig
from perception.render.bar_plots import plot_shares
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
_SPECS = dict.fromkeys(
    ("published [%]", "thesis [%]", "default [%]", "thesis [ms]", "default [ms]"), ".1f"
)
_PREVIOUS_SCANS = 6  # m of Table 7.1


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


def stages(
    drive: str,
    *,
    source: DriveOfStudy,
    frames: int = 10,
    out: Path = RESULTS / "stages.png",
) -> None:
    """Measure the share of the time of each stage: published, repeated, and by default (Table 7.3).

    Example: trifuse study stages synthetic

    Args:
        drive: Folder of a drive with INS, or the word synthetic.
        frames: Number of measured frames, after those that fill the window.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    require_positive("--frames", frames)
    opened = source.open(drive)
    thesis, default = (
        mean_times_s(
            stage_times(opened, chain_config(method, _PREVIOUS_SCANS), _PREVIOUS_SCANS, frames)
        )
        for method in ("thesis", "default")
    )
    title = f"Share of time by stage, {opened.name}, {frames} frames, m = {_PREVIOUS_SCANS}"
    bars = {
        f"thesis, published\n(MATLAB, {PUBLISHED_FRAMES_PER_S} frames/s)": PUBLISHED_PERCENT,
        f"thesis' method here\n{_total(thesis)}": thesis,
        f"default method\n{_total(default)}": default,
    }
    plot_shares(out, title, bars)
    sources = [PUBLISHED_PERCENT, thesis, default]
    totals = [sum(source.values()) for source in sources]
    rows = {
        f"({letter}) {stage}": (
            *(100 * source[stage] / total for source, total in zip(sources, totals, strict=True)),
            1e3 * thesis[stage],
            1e3 * default[stage],
        )
        for letter, stage in zip("abcd", PUBLISHED_PERCENT, strict=True)
    }
    rows["all stages"] = (100.0, 100.0, 100.0, 1e3 * totals[1], 1e3 * totals[2])
    publish(
        out,
        "Table 7.3",
        {"stages": formatted_table(title, "stage", _SPECS, rows)},
        {"drive": opened.name, "frames": frames, "previous_scans": _PREVIOUS_SCANS},
    )


def _total(times: dict[str, float]) -> str:
    return f"{1e3 * sum(times.values()):.0f} ms, {1 / sum(times.values()):.1f} frames/s"
