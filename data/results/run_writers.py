"""The writers of a run, by its configuration."""

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future
from functools import partial
from pathlib import Path

from data.frames import clock_origin_ns, frame_count, frame_period_s, further_camera_names
from data.recorded_drive import RecordedDrive
from data.report.page import can_write_report
from data.results.process_writer import ProcessWriter
from data.results.result_writer import ResultWriter
from data.results.run_config import RunConfig
from data.results.run_folder import RunFiles
from data.results.run_video import RunVideo
from perception.detection.networks import chosen_detection
from perception.pipeline.workers import ThreadWorker
from perception.render.composition import Composition
from perception.render.scene import SelectedObject
from perception.types import Drive, Progress, Result

# Bounds the memory of frames that wait to be written.
_MAX_QUEUED = 2
_BEV_REACH_M = 50.0  # that the video shows all round


class BackgroundWriter(ResultWriter):
    """Runs another writer in a thread; its errors are raised by the next call."""

    def __init__(self, writer: ResultWriter, name: str) -> None:
        """Start the thread.

        Args:
            writer: Writer that runs in the thread.
            name: Name of the thread.
        """
        self._writer, self._worker = writer, ThreadWorker(name)
        self._queue: deque[Future[None]] = deque()

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Queue the next frame; wait while the queue is full."""
        self._wait_for(_MAX_QUEUED - 1)
        self._queue.append(self._worker.submit(self._writer.add, result, selected))

    def snapshot(self) -> bytes:
        """Write the queue; return the snapshot of the writer."""
        self._wait_for(0)
        return self._writer.snapshot()

    def restore(self, snapshot: bytes) -> None:
        """Restore the writer."""
        self._writer.restore(snapshot)

    def close(self, *, is_complete: bool) -> None:
        """Write the queue and finish; incomplete where something goes wrong meanwhile."""
        is_written = False
        try:
            self._wait_for(0)
            is_written = True
        finally:
            self._worker.close()
            self._writer.close(is_complete=is_complete and is_written)

    def _wait_for(self, length: int) -> None:
        while len(self._queue) > length:
            self._queue.popleft().result()


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
        progress: Progress bar of the report, or of the proposals of labels.
    """
    if config.proposes and isinstance(drive, RecordedDrive):
        from data.label_proposals.proposal_writer import ProposalWriter

        yield ProposalWriter(out, drive, progress)
        return
    pipeline = config.pipeline
    detection = chosen_detection(pipeline.detection, drive.sensor, pipeline.method)
    area = pipeline.area_of(drive.sensor)
    composition = Composition(
        area=area,
        reach_m=_BEV_REACH_M if "bev" in (detection.modalities or ()) else 0.0,
        period_s=frame_period_s(drive),
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
    yield RunFiles(out, drive, area, config.min_vehicle_score)
    if config.exports.mcap:
        from data.exports.mcap_writer import McapWriter

        min_score = config.pipeline.detection.display_score
        yield BackgroundWriter(
            McapWriter(
                out / "results.mcap", min_score, clock_origin_ns(drive), further_camera_names(drive)
            ),
            "mcap",
        )
    if config.exports.occupancy:
        from data.exports.occupancy_writer import OccupancyWriter

        yield BackgroundWriter(OccupancyWriter(out), "occupancy")
    if config.exports.tables:
        from data.exports.table_writer import TableWriter

        yield TableWriter(out, config.min_vehicle_score)
    if config.exports.nuscenes is not None and isinstance(drive, RecordedDrive):
        from data.exports.nuscenes_writer import NuScenesWriter

        yield NuScenesWriter(config.exports.nuscenes, drive)
    if config.exports.labels is not None and isinstance(drive, RecordedDrive):
        from data.exports.label_writer import LabelWriter

        score = config.pipeline.detection.display_score
        yield LabelWriter(config.exports.labels, config.exports.label_form, drive, score)
    if config.exports.rerun is not None or config.exports.view:
        from data.exports.rerun_writer import RerunWriter

        score = config.pipeline.detection.display_score
        view, path = config.exports.view, config.exports.rerun
        writer = RerunWriter(drive.name, path, view=view, display_score=score)
        yield BackgroundWriter(writer, "rerun")
