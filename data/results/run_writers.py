"""The writers of a run, by its configuration."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from data.frames import clock_origin_ns, frame_count, further_camera_names
from data.report.page import can_write_report
from data.results.background_writer import BackgroundWriter
from data.results.process_writer import ProcessWriter
from data.results.result_writer import ResultWriter
from data.results.run_config import RunConfig
from data.results.run_folder import RunFiles
from data.results.run_video import RunVideo
from perception.render.composition import Composition
from perception.types import Drive, Progress


def run_writers(
    drive: Drive,
    out: Path,
    config: RunConfig,
    drawing: ProcessWriter | None,
    progress: Progress = iter,
) -> Iterator[ResultWriter]:
    """Make the writers that a run asks for; optional packages are imported by those that need them.

    Args:
        drive: Drive of the run.
        out: Folder of the results.
        config: Configuration of the run.
        drawing: Process of the video; None for no video.
        progress: Progress bar of the report.
    """
    composition = Composition(
        area=config.pipeline.area,
        turn_s=1 / drive.sensor.rate_hz,
        display_score=config.pipeline.detection.display_score,
        detector_views=config.video_views,
    )
    frames = frame_count(drive, config.frames)
    if config.exports.report and can_write_report():
        from data.report.run_writer import RunReportWriter

        # First, and so closed last: it reads the files of the others.
        yield RunReportWriter(
            out, drive, composition, frames, has_video=drawing is not None, progress=progress
        )
    if drawing is not None:
        drawing.start(partial(RunVideo, out, composition, frames, is_sequence=drive.is_sequence))
        yield BackgroundWriter(drawing, "video")
    yield RunFiles(out, drive, config.pipeline.area, config.min_vehicle_score)
    if config.exports.mcap:
        from data.exports.mcap_writer import McapWriter

        min_score = config.pipeline.detection.display_score
        yield BackgroundWriter(
            McapWriter(
                out / "results.mcap", min_score, clock_origin_ns(drive), further_camera_names(drive)
            ),
            "mcap",
        )
    if config.exports.tables:
        from data.exports.table_writer import TableWriter

        yield TableWriter(out, config.min_vehicle_score)
    if config.exports.rerun is not None or config.exports.view:
        from data.exports.rerun_writer import RerunWriter

        score = config.pipeline.detection.display_score
        view, path = config.exports.view, config.exports.rerun
        writer = RerunWriter(drive.name, path, view=view, display_score=score)
        yield BackgroundWriter(writer, "rerun")
