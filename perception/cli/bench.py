"""`trifuse bench`: every stage beside its plain form and the best library for it."""

import logging
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Literal

from tqdm import tqdm

from data.open_drive import open_drive
from data.results.documents import describe_machine, write_json
from data.synthetic.drive import SyntheticDrive
from perception.cli.table import format_table
from perception.detection.config import DetectionConfig
from perception.errors import ModelError, PerceptionError
from perception.geometry.threads import limit_blas_threads
from perception.pipeline import PipelineConfig
from perception.sensor import HDL_64E, load_sensor
from perception.types import Drive

if TYPE_CHECKING:
    from benchmarks.chain import ChainMetrics

log = logging.getLogger(__name__)

BenchmarkPart = Literal[
    "all", "chain", "pipeline", "registration", "ground", "voxels", "motion",
    "objects", "map", "filters", "following", "colors", "maps",
    "clusters", "turns", "proposals", "depthcn", "average-precision", "detectors",
]  # fmt: skip


def bench(  # noqa: PLR0913 - flags of a command
    drive: Path | None = None,
    *,
    sequence: str | None = None,
    sensor: str | None = None,
    part: BenchmarkPart = "all",
    frames: int = 30,
    chain_frames: int = 150,
    detection: DetectionConfig = DetectionConfig(),  # noqa: B008 - frozen
    json: Path | None = None,
) -> None:
    """Time every stage beside its plain form, the thesis' form and the best library, in one run.

    Contenders take turns on the same frames, so that their ratio holds on any machine.

    Example: trifuse bench --drive kitti/tracking --sequence 0000 --part ground --frames 154

    Args:
        drive: what to run on; else a synthetic street.
        sequence: which one, where there are several.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        part: one stage, the chain, or all but the detectors, whose networks take a minute to make.
        frames: for each stage.
        chain_frames: for the whole chain and for the pipeline, driving back from the end; 1000 shows that memory stays flat.
        detection: which detectors are part of the pipeline.
        json: gets the same figures.
    """
    chain, pipeline, stages, comparisons = _import_benchmarks()
    model = load_sensor(sensor) if sensor else HDL_64E
    needs_images = part in ("all", "pipeline", "following", "detectors")
    opened: Drive = (
        SyntheticDrive(frames, sensor=model, images=needs_images)
        if drive is None
        else open_drive(
            drive, sequence=sequence, sensor=sensor, images=needs_images or part == "maps"
        )
    )
    config = PipelineConfig.for_motion()
    machine = describe_machine()
    print(f"{opened.name}, {opened.sensor.name}, on {machine}\n", flush=True)
    document: dict[str, object] = {"drive": opened.name, "machine": machine, "config": config}
    if part in ("all", "pipeline"):
        modes = pipeline.measure_pipeline(opened, chain_frames, PipelineConfig(detection=detection))
        print(f"{pipeline.pipeline_table(modes)}\n", flush=True)
        document["pipeline"] = modes
    if part in ("all", "chain"):
        thesis = PipelineConfig.for_motion("thesis")
        metrics = {
            "default": chain.measure_chain(opened, chain_frames, config),
            # The thesis' form is some thirty times slower: a tenth of the frames shows it.
            "thesis": chain.measure_chain(
                opened, max(chain_frames // 10, 10), replace(thesis, method="thesis")
            ),
        }
        print(f"{_chain_table(metrics)}\n", flush=True)
        document["chain"] = metrics
    known = {**comparisons.COMPARISONS, **comparisons.ON_REQUEST}
    chosen = (
        list(comparisons.COMPARISONS) if part == "all" else [name for name in known if name == part]
    )
    prepared = stages.prepare(opened, frames, PipelineConfig.for_obstacles()) if chosen else None
    for name in tqdm(chosen, "stages", file=sys.stderr, disable=not chosen):
        try:
            with limit_blas_threads():
                comparison = known[name](prepared)
        except ModelError as error:  # a network that did not come with this copy
            if part != "all":
                raise
            log.warning("left out: %s", error)
            continue
        tqdm.write(f"{comparison.table()}\n")
        document[name] = comparison
    if json is not None:
        write_json(json, document)


def _import_benchmarks() -> tuple[ModuleType, ...]:
    """Return the benchmark modules, which only the source tree holds."""
    try:
        from benchmarks import chain, comparisons, pipeline, stages
    except ImportError as error:
        raise PerceptionError(
            "trifuse bench",
            expected="the benchmarks/ folder of the source tree",
            found=str(error),
            advice="clone the project and install it with: pip install --editable .",
        ) from error
    return chain, pipeline, stages, comparisons


def _chain_table(metrics: dict[str, "ChainMetrics"]) -> str:
    """Return speed, worst frames and memory of the whole chain, ours and the thesis'."""
    default = metrics["default"]
    rows = [
        [
            method,
            str(f.frames),
            f"{f.frames_per_s:.1f}",
            f"{f.median_ms:.1f}",
            f"{f.p99_ms:.1f}",
            f"{f.median_ms / default.median_ms:.1f}x",
            ", ".join(f"{name} {ms:.1f}" for name, ms in f.stages_ms.items()),
            f"{f.memory_start_mib:.0f} to {f.memory_end_mib:.0f}",
        ]
        for method, f in metrics.items()
    ]
    header = ("", "frames", "frames/s", "median ms", "99 % ms", "ours = 1", "stages ms", "MiB")
    return format_table("whole chain (the thesis reports 0.3 frames/s)", header, rows)
