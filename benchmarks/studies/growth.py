"""Processor time of a frame over the beams and points of the LiDAR, the local area, and the length of the drive."""

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.measure import memory_mib, processor_clock
from benchmarks.studies.report import RESULTS, formatted_table, publish
from perception.cli.flags import require_positive
from perception.cli.parser import FlagGroup
from perception.cli.progress import progress_bar
from perception.evaluation.report import Table
from perception.evaluation.stage_times import ALL_STAGES
from perception.geometry.grids import LocalArea
from perception.pipeline import PipelineConfig
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.sensor import HDL_64E, VLP_16, LidarModel
from perception.types import Drive, Frame

if TYPE_CHECKING:
    from perception.pipeline import Pipeline

WARM_UP = 8  # frames that fill the window of scans
_BLOCKS = 20  # of a long run
_SHORT_DRIVE = 60  # frames of the drive that the long run plays back and forth
_BEAMS = (16, 32, 128)  # beside the 64 of an HDL-64E
_STEP_RATIOS = (4.0, 2.0, 0.5)  # azimuth steps relative to those of an HDL-64E
# The default, and squares up to all that a detector from above sees.
_AREAS = (
    PipelineConfig().area_of(HDL_64E),
    *(LocalArea(half, half, half) for half in (20.0, 30.0, 50.0)),
)


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
    from benchmarks.pipeline import FrameSource
    from perception.pipeline import Pipeline

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
    from perception.pipeline import Pipeline

    with processor_clock(), Pipeline(sensor, config) as pipeline:
        times = list(_stage_times(pipeline, frames))[WARM_UP:]
    stages = dict.fromkeys(stage for frame in times for stage in frame)
    return {
        stage: 1e3 * float(np.median([frame[stage] for frame in times if stage in frame]))
        for stage in stages
    }


def _stage_times(pipeline: "Pipeline", frames: Iterable[Frame]) -> Iterator[dict[str, float]]:
    for frame in frames:
        start_s = time.process_time()
        timings_s = pipeline.step(frame).timings_s
        yield {**timings_s, ALL_STAGES: time.process_time() - start_s}


def _cpu_s(pipeline: "Pipeline", frame: Frame) -> float:
    start_s = time.process_time()
    pipeline.step(frame)
    return time.process_time() - start_s


@dataclass(frozen=True)
class GrowthConfig(FlagGroup):
    """Drives.

    Attributes:
        frames: Number of measured frames of each LiDAR and area.
        length: Number of frames of the long run, back and forth over a short drive; 20000 is half an hour at 10 Hz.
        detect: Whether detectors, fusion, DepthCN and vehicles run as well, on images.
        seed: Seed of the drives.
    """

    frames: int = 10
    length: int = 400
    detect: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate the numbers of frames."""
        require_positive("--frames", self.frames)
        require_positive("--length", self.length)

    @property
    def pipeline(self) -> PipelineConfig:
        """Configuration of the pipeline: one stage after another."""
        config = PipelineConfig() if self.detect else PipelineConfig.for_motion()
        return replace(config, parallel=False)

    def drive(self, frames: int, sensor: LidarModel) -> Drive:
        """Return the street by a LiDAR."""
        from data.synthetic.drive import SyntheticDrive

        return SyntheticDrive(frames, seed=self.seed, sensor=sensor, images=self.detect)


def growth(*, config: GrowthConfig, out: Path = RESULTS / "growth.png") -> None:
    """Measure the processor time of a frame over beams, points, area and the length of the drive.

    Example: trifuse study growth --length 20000

    Args:
        out: Figure; a JSON file with the numbers is written beside it.
    """
    # First, while the memory holds nothing else.
    run = long_run(config.drive(_SHORT_DRIVE, VLP_16), config.length, config.pipeline)
    by_beams, by_step = _by_sensor(config)
    by_area = _by_area(config)
    points, area = "points of a scan", "area [m²]"
    panels = [
        CurvePanel(
            "LiDAR",
            points,
            "CPU [ms]",
            [_curve("16 to 128 beams", by_beams), _curve("64 beams, finer steps", by_step)],
        ),
        CurvePanel("local area", area, "CPU [ms]", _stage_curves(by_area)),
        CurvePanel("long run", "frames", "CPU [ms]", [_blocks(run, run.medians_ms)]),
        CurvePanel("long run", "frames", "memory [MiB]", [_blocks(run, run.memory_mib)]),
    ]
    stages = "all stages" if config.detect else "stages of the LiDAR"
    title = f"Processor time of a frame, {stages}, synthetic drives of seed {config.seed}"
    plot_curves(out, title, panels, columns=2)
    tables = {
        "lidar": _table(f"{title}, by LiDAR", points, {**by_beams, **by_step}),
        "area": _table(f"{title}, by area", area, by_area),
        "length": _long_table(run),
    }
    publish(out, "none: the thesis has one sensor and area", tables, {"config": config})


def _by_sensor(config: GrowthConfig) -> tuple[dict[str, FrameCost], dict[str, FrameCost]]:
    """Return the costs by the number of beams, and by the number of points of 64 beams."""
    beams = {f"{number} beams": _with_beams(number) for number in _BEAMS}
    steps = {
        f"64 beams, step x {ratio:g}": replace(
            HDL_64E, name=f"step x {ratio:g}", azimuth_step_rad=ratio * HDL_64E.azimuth_step_rad
        )
        for ratio in _STEP_RATIOS
    }
    costs = {}
    for name, sensor in {**beams, "64 beams": HDL_64E, **steps}.items():
        frames = _frames(config, sensor)
        size = float(np.median([len(frame.points_velo) for frame in frames]))
        costs[name] = FrameCost(size, median_stages_ms(sensor, frames, config.pipeline))
    return _sorted(costs, [*beams, "64 beams"]), _sorted(costs, [*steps, "64 beams"])


def _by_area(config: GrowthConfig) -> dict[str, FrameCost]:
    frames, costs = _frames(config, HDL_64E), {}
    for area in _AREAS:
        long_m, wide_m = area.ahead_m + area.behind_m, 2 * area.side_m
        pipeline = replace(config.pipeline, area=area)
        stages_ms = median_stages_ms(HDL_64E, frames, pipeline)
        costs[f"{long_m:g} m x {wide_m:g} m"] = FrameCost(long_m * wide_m, stages_ms)
    return costs


def _frames(config: GrowthConfig, sensor: LidarModel) -> list[Frame]:
    """Return the frames of a street in memory."""
    return list(config.drive(WARM_UP + config.frames, sensor))


def _with_beams(number: int) -> LidarModel:
    """Return an HDL-64E of another number of beams, spread evenly between its highest and its lowest."""
    high, low = HDL_64E.elevations_rad[[0, -1]]
    elevations_rad = np.linspace(high, low, number)
    return replace(HDL_64E, name=f"{number} beams", elevations_rad=elevations_rad)


def _sorted(costs: Mapping[str, FrameCost], names: Sequence[str]) -> dict[str, FrameCost]:
    """Return some of the costs by their names, the least points first."""
    return {name: costs[name] for name in sorted(names, key=lambda name: costs[name].size)}


def _curve(name: str, costs: Mapping[str, FrameCost]) -> Curve:
    rows = list(costs.values())
    return Curve(name, [cost.size for cost in rows], [cost.all_ms for cost in rows])


def _stage_curves(costs: Mapping[str, FrameCost]) -> list[Curve]:
    rows = list(costs.values())
    sizes = [cost.size for cost in rows]
    return [
        Curve(
            stage,
            sizes,
            [cost.stages_ms[stage] for cost in rows],
            is_emphasised=stage == ALL_STAGES,
        )
        for stage in reversed(list(rows[0].stages_ms))
    ]


def _blocks(run: LongRun, values: Sequence[float]) -> Curve:
    return Curve("VLP-16, back and forth", list(map(float, run.frames)), values)


def _table(title: str, size: str, costs: Mapping[str, FrameCost]) -> Table[object]:
    """Return the cost of each stage in milliseconds by setting, and of the whole frame relative to the first."""
    first = next(iter(costs.values()))
    stages = list(first.stages_ms)
    specs = {size: ".0f", **{f"{stage} [ms]": ".1f" for stage in stages}, "relative time": ".2f"}
    rows = {
        name: [
            cost.size,
            *(cost.stages_ms[stage] for stage in stages),
            cost.all_ms / first.all_ms,
        ]
        for name, cost in costs.items()
    }
    return formatted_table(title, "", specs, rows)


def _long_table(run: LongRun) -> Table[object]:
    specs = {"CPU p50 [ms]": ".2f", "memory [MiB]": ".1f"}
    rows = {
        f"until {end}": [median_ms, mib]
        for end, median_ms, mib in zip(run.frames, run.medians_ms, run.memory_mib, strict=True)
    }
    return formatted_table("Long run, VLP-16, back and forth", "frame", specs, rows)
