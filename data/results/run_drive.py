"""The results of the pipeline over a drive: written, drawn and summed up."""

import logging
import time
from collections.abc import Generator, Iterable, Iterator
from dataclasses import replace

from data.frames import frame_period_s
from data.results.checkpoint import Checkpoint, Checkpoints
from data.results.documents import write_json
from data.results.folder import ResultsFolder, started
from data.results.process_writer import ProcessWriter
from data.results.result_writer import open_writers
from data.results.run_config import RunConfig
from data.results.run_writers import run_writers
from perception.errors import PerceptionError, UsageError
from perception.evaluation.run_summary import RunSummary
from perception.geometry.threads import limit_blas_threads
from perception.obstacles.occupancy import occupancy_grid
from perception.pipeline.memory import release_free_memory
from perception.render.bar_plots import plot_timeline
from perception.render.scene import SelectedObject
from perception.tracking.single_object.handover import TrackHandover
from perception.types import Drive, Progress, Result

log = logging.getLogger(__name__)

TRACKING_STAGE = "object tracking"


def run_drive(
    drive: Drive,
    results: Generator[Result, None, None],
    folder: ResultsFolder,
    config: RunConfig,
    checkpoint: Checkpoint | None = None,
    report_progress: Progress = iter,
) -> RunSummary:
    """Write the results of the pipeline; every result file is complete after each frame.

    Args:
        drive: Drive of the run.
        results: Results of the pipeline, frame by frame; closed at the end.
        folder: Folder for the results; nothing is written before the first result is there.
        config: Configuration of the run.
        checkpoint: Checkpoint that a run which was killed has left in the folder, where the results go on from it.
        report_progress: Progress bar of the report, which is written at the end.

    Raises:
        PerceptionError: A frame cannot be used; the results of the frames before it stay.
        UsageError: The run goes on with other outputs.
    """
    start_s = time.perf_counter()
    handover = _handover(drive, config) if checkpoint is None else checkpoint.handover
    # It starts while the networks are opened, and ends with this process where the first frame cannot be read.
    drawing = ProcessWriter("video") if config.video else None
    steps = started(track_selected(results, handover))
    out = folder.prepare()
    period_s, pipeline = frame_period_s(drive), config.pipeline
    shows_grid = config.exports.occupancy
    score = pipeline.detection.display_score
    summary = RunSummary(drive.name, out, pipeline.area_of(drive.sensor), score, period_s)
    if checkpoint is not None:
        checkpoint.rewind(out)
        summary = replace(checkpoint.summary, out=out)
        start_s -= summary.elapsed_s
    checkpoints = Checkpoints(out, handover)
    with open_writers(run_writers(drive, out, config, drawing, report_progress)) as writers:
        if checkpoint is not None:
            if len(writers) != len(checkpoint.writers):
                expected = "--nuscenes and --labels as of the run that was stopped"
                raise UsageError("--resume", expected=expected, found="another number of outputs")
            for writer, snapshot in zip(writers, checkpoint.writers, strict=True):
                writer.restore(snapshot)
        try:
            for result, selected in steps:
                grid = occupancy_grid(result, pipeline.occupancy) if shows_grid else None
                for writer in writers:
                    writer.add(replace(result, snapshot=None, occupancy=grid), selected)
                summary.update(result, drive.point_truth(result.frame.index))
                if result.snapshot is not None:
                    summary.elapsed_s = time.perf_counter() - start_s
                    checkpoints.write(result.frame.index + 1, result.snapshot, summary, writers)
            summary.is_complete = True
        except PerceptionError:
            log.warning("frames done: %d; their results are kept in %s", summary.frames, out)
            raise
        finally:
            results.close()
            release_free_memory()  # the networks are closed; writers may take as much at their end
            summary.elapsed_s = time.perf_counter() - start_s
            write_json(out / "summary.json", {"sensor": drive.sensor.name, **summary.to_json()})
    summary.elapsed_s = time.perf_counter() - start_s  # with what the writers do at their end
    if summary.frames:
        title = f"{drive.name}: a typical frame"
        plot_timeline(out / "timeline.png", title, summary.times.typical(), period_s)
    checkpoints.remove()
    return summary


def track_selected(
    results: Iterable[Result], handover: TrackHandover | None
) -> Iterator[tuple[Result, SelectedObject | None]]:
    """Yield each frame with the object that a one-object tracker follows, None before it appears.

    Args:
        results: Results of the pipeline.
        handover: Tracker that waits for the object; None to track nothing.
    """
    if handover is None:
        yield from ((result, None) for result in results)
        return
    for result in results:
        start_s = time.perf_counter()
        with limit_blas_threads():
            tracked = handover.update(result)
        timings_s = {**result.timings_s, TRACKING_STAGE: time.perf_counter() - start_s}
        selected = None if tracked is None else SelectedObject(handover.track_id, tracked)
        yield replace(result, timings_s=timings_s), selected
    if not handover.has_started:
        log.warning(
            "--track %d: no frame has a track or a located vehicle of this id; tracks.jsonl and "
            "vehicles.jsonl hold the ids of this run",
            handover.track_id,
        )


def _handover(drive: Drive, config: RunConfig) -> TrackHandover | None:
    if config.track is None:
        return None
    # These trackers take half a second to import.
    from perception.tracking.single_object.trackers import single_object_tracker

    tracker = single_object_tracker(config.tracker, drive.sensor, config.tracker_config)
    return TrackHandover(config.track, tracker, config.pipeline.ego_vehicle)
