"""The results of the pipeline over a drive: written, drawn and summed up."""

import logging
import time
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from data.frames import frame_count
from data.results.documents import write_json
from data.results.folder import ResultsFolder, started
from data.results.objects import TrajectoryRecord
from data.results.records import append_record
from data.results.run_folder import append_frame
from data.results.run_video import RunVideo
from perception.errors import PerceptionError, UsageError
from perception.evaluation.run_summary import RunSummary
from perception.geometry.threads import limit_blas_threads
from perception.pipeline import PipelineConfig
from perception.render.bar_plots import plot_timeline
from perception.render.composition import Composition
from perception.render.scene import SelectedObject
from perception.tracking.single_object.config import SingleObjectTrackerConfig, TrackerName
from perception.tracking.single_object.handover import TrackHandover
from perception.types import Drive, Result

log = logging.getLogger(__name__)

TRACKING_STAGE = "object tracking"


@dataclass(frozen=True)
class RunConfig:
    """Configuration of a run.

    Attributes:
        frames: Number of frames from the start; None for all.
        video: Whether the video is drawn.
        video_views: Whether the video shows the boxes of each modality's detector.
        pipeline: Pipeline configuration.
        track: Id of the track or vehicle that a one-object tracker takes over, or None.
        tracker: Name of the one-object tracker.
        tracker_config: Parameters of the one-object trackers.
        min_vehicle_score: Score from which a detected vehicle is listed in vehicles.jsonl, 0 to 1.
    """

    frames: int | None = None
    video: bool = True
    video_views: bool = False
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    track: int | None = None
    tracker: TrackerName = "default"
    tracker_config: SingleObjectTrackerConfig = field(default_factory=SingleObjectTrackerConfig)
    min_vehicle_score: float = 0.05

    def __post_init__(self) -> None:
        """Validate the score and the tracker."""
        if not 0 <= self.min_vehicle_score <= 1:
            raise UsageError(
                "min_vehicle_score",
                expected="a score from 0 to 1",
                found=f"{self.min_vehicle_score:g}",
            )
        if self.track is None and self.tracker != RunConfig.tracker:
            raise UsageError(
                f"--tracker {self.tracker}",
                expected="the id of a track or vehicle for it",
                found="none",
                advice="name one with --track; tracks.jsonl and vehicles.jsonl of a run hold the ids",
            )


def run_drive(
    drive: Drive,
    results: Generator[Result, None, None],
    folder: ResultsFolder,
    config: RunConfig,
) -> RunSummary:
    """Write the results of the pipeline; every result file is complete after each frame.

    Args:
        drive: Drive of the run.
        results: Results of the pipeline, frame by frame; closed at the end.
        folder: Folder for the results; nothing is written before the first result is there.
        config: Configuration of the run.

    Raises:
        PerceptionError: A frame cannot be used; the results of the frames before it stay.
    """
    pipeline, start_s = config.pipeline, time.perf_counter()
    steps = started(track_selected(results, _handover(drive, config)))
    out = folder.prepare()
    summary = RunSummary(drive.name, out, pipeline.area, pipeline.detection.display_score)
    with _open_video(drive, out, config) as video:
        try:
            for result, selected in steps:
                video.add(result, selected)
                append_frame(out, drive, result, pipeline.area, config.min_vehicle_score)
                if selected is not None:
                    record = TrajectoryRecord.of(
                        result, selected.tracked, selected.track_id, kind=None
                    )
                    append_record(out / "trajectory.jsonl", record)
                summary.update(result, drive.point_truth(result.frame.index))
        except PerceptionError:
            log.warning("frames done: %d; their results are kept in %s", summary.frames, out)
            raise
        finally:
            results.close()
            summary.elapsed_s = time.perf_counter() - start_s
            write_json(out / "summary.json", {"sensor": drive.sensor.name, **summary.to_json()})
    if summary.frames:
        title = f"{drive.name}: a typical frame"
        plot_timeline(
            out / "timeline.png", title, summary.times.typical(), 1 / drive.sensor.rate_hz
        )
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


def _open_video(drive: Drive, out: Path, config: RunConfig) -> RunVideo:
    composition = Composition(
        area=config.pipeline.area,
        turn_s=1 / drive.sensor.rate_hz,
        display_score=config.pipeline.detection.display_score,
        detector_views=config.video_views,
    )
    count = frame_count(drive, config.frames)
    return RunVideo(out, composition if config.video else None, drive, count)


def _handover(drive: Drive, config: RunConfig) -> TrackHandover | None:
    if config.track is None:
        return None
    # These trackers take half a second to import.
    from perception.tracking.single_object.trackers import single_object_tracker

    tracker = single_object_tracker(config.tracker, drive.sensor, config.tracker_config)
    return TrackHandover(config.track, tracker, config.pipeline.ego_vehicle)
