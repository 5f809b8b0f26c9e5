"""`trifuse bench`."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

from data.results.command_config import SECTION, CommandConfig
from perception.cli.flags import ReportFlags, SourceFlags
from perception.detection.config import DetectionConfig
from perception.errors import ModelError
from perception.pipeline import PipelineConfig
from perception.types import Drive

log = logging.getLogger(__name__)

BenchmarkPart = Literal[
    "all", "chain", "pipeline", "registration", "ground", "voxels", "motion",
    "objects", "short-term-map", "kalman-filters", "single-object", "color-model", "maps",
    "clusters", "clusters-full-scan", "proposals", "depthcn", "video", "average-precision", "detectors",
    "vehicle-tracking", "camera-detectors", "bev",
]  # fmt: skip

_DETECTION = DetectionConfig()


def bench(  # noqa: D417, PLR0913 - flags of a command
    *,
    source: SourceFlags,
    report: ReportFlags,
    config: CommandConfig,
    drive: Path | None = None,
    part: BenchmarkPart = "all",
    frames: int = 30,
    chain_frames: int = 150,
    compare: str | None = None,
    detection: DetectionConfig = _DETECTION,
) -> None:
    """Time every stage beside its reference implementation, the thesis' method and the best library.

    All contenders of a part run on the same frames in turns, so that their ratio holds on any machine.

    Example: trifuse bench --drive kitti/tracking --sequence 0000 --part ground --frames 154

    Args:
        drive: Drive to run on; else a synthetic street.
        part: One stage, the chain of obstacle stages, the pipeline, or all; detectors and bev only run by name, since
            making their networks takes a minute, vehicle-tracking, since it needs labels, and camera-detectors, beside
            the networks of the folder PUBLIC_NETWORKS (environment), with average precision where there are labels.
        frames: Number of frames for each stage.
        chain_frames: Number of frames for the chain and the pipeline, back and forth over the drive; 1000 show
            that the memory is bounded.
        compare: Revision, as git knows it, with which this source tree takes turns: processor time of each stage
            of the default pipeline, in place of all other parts.
        detection: Detectors of the pipeline.
    """
    from benchmarks import comparisons, pipeline, stages
    from data.results.documents import describe_machine
    from perception.geometry.threads import limit_blas_threads

    if compare is not None:
        _compare_with_revision(compare, drive, source, report, frames)
        return
    opened = _open(drive, source, frames, part)
    machine = describe_machine()
    print(f"{opened.name}, {opened.sensor.name}, on {machine}\n", flush=True)
    document: dict[str, object] = {
        "drive": opened.name,
        "machine": machine,
        SECTION: config.values,
    }
    if part in ("all", "pipeline"):
        modes = pipeline.measure_pipeline(opened, chain_frames, PipelineConfig(detection=detection))
        _print(pipeline.run_tables("whole pipeline", modes, "parallel"))
        document["pipeline"] = modes
    if part in ("all", "chain"):
        methods = pipeline.measure_chain(opened, chain_frames)
        title = "obstacle chain (the thesis reports 0.3 frames/s)"
        _print(pipeline.run_tables(title, methods, "default"))
        document["chain"] = methods
    known = {**comparisons.COMPARISONS, **comparisons.ON_REQUEST}
    chosen = list(comparisons.COMPARISONS) if part == "all" else [n for n in known if n == part]
    if chosen:
        prepared = stages.prepare(opened, frames, PipelineConfig.for_obstacles())
    for name in chosen:
        try:
            with limit_blas_threads():
                comparison = known[name](prepared)
        except ModelError as error:  # a network that is not in this installation
            if part != "all":
                raise
            log.warning("skipped: %s", error)
            continue
        _print(comparison.text())
        document[name] = comparison.to_json()
    if report.has_files:
        report.write(document)


def _compare_with_revision(
    revision: str, drive: Path | None, source: SourceFlags, report: ReportFlags, frames: int
) -> None:
    """Print the processor time of each stage in this source tree and in another revision."""
    from benchmarks.revisions import compare_with_revision
    from data.results.documents import describe_machine

    with _on_disk(drive, source, frames) as path:
        words = (source.sequence, source.sensor, source.camera)
        table = compare_with_revision(revision, path, frames, words)
    machine = describe_machine()
    _print(f"{table.text()}\non {machine}")
    if report.has_files:
        report.write({"machine": machine, "stages": table.to_json()})


@contextmanager
def _on_disk(drive: Path | None, source: SourceFlags, frames: int) -> Iterator[Path]:
    """Yield the path of the drive, or of a synthetic one, which two processes read."""
    if drive is not None:
        yield drive
        return
    from benchmarks.revisions import WARM_UP
    from data.synthetic.collection import SynthConfig, write_drives
    from perception.sensor import HDL_64E, load_sensor

    sensor = load_sensor(source.sensor) if source.sensor else HDL_64E
    with TemporaryDirectory(prefix="trifuse-") as folder:
        yield write_drives(Path(folder), SynthConfig(frames=WARM_UP + frames, sensor=sensor))[0]


def _print(table: str) -> None:
    print(f"{table}\n", flush=True)


def _open(drive: Path | None, source: SourceFlags, frames: int, part: BenchmarkPart) -> Drive:
    from data.open_drive import open_drive
    from data.synthetic.drive import SyntheticDrive
    from perception.sensor import HDL_64E, load_sensor

    needs_images = part in (
        "all", "pipeline", "single-object", "video", "detectors", "vehicle-tracking",
        "camera-detectors",
    )  # fmt: skip
    if drive is None:
        sensor = load_sensor(source.sensor) if source.sensor else HDL_64E
        return SyntheticDrive(frames, sensor=sensor, images=needs_images)
    images = needs_images or part == "maps"
    return open_drive(drive, sequence=source.sequence, config=source.reading, images=images)
