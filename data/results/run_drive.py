"""The results of the pipeline over a drive: written, drawn and summed up."""

import logging
import time
from collections.abc import Generator
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

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
from perception.tracking.single_object.handover import TrackHandover
from perception.tracking.single_object.trackers import single_object_tracker
from perception.types import Drive, OnBadFrame, Result

log = logging.getLogger(__name__)

TRACKING_STAGE = "object tracking"


@dataclass(frozen=True)
class RunConfig:
    """Configuration of a run.

    Attributes:
        frames: Number of frames from the start; None for all.
        video: Whether the video is drawn.
        video_views: Whether the video shows the boxes of each modality's detector.
        on_bad_frame: Stop at a damaged frame, or skip it.
        pipeline: Pipeline configuration.
        track: Id of the track or vehicle that a one-object tracker takes over, or None.
        min_vehicle_score: Score from which a detected vehicle is listed in vehicles.jsonl, 0 to 1.
    """

    frames: int | None = None
    video: bool = True
    video_views: bool = False
    on_bad_frame: OnBadFrame = "stop"
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    track: int | None = None
    min_vehicle_score: float = 0.05

    def __post_init__(self) -> None:
        """Validate the score."""
        if not 0 <= self.min_vehicle_score <= 1:
            raise UsageError(
                "min_vehicle_score",
                expected="a score from 0 to 1",
                found=f"{self.min_vehicle_score:g}",
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
    pipeline, handover = config.pipeline, _handover(drive, config)
    start = time.perf_counter()
    all_results = started(results)
    out = folder.prepare()
    summary = RunSummary(drive.name, out, pipeline.area, pipeline.detection.display_score)
    with ExitStack() as files:
        video = files.enter_context(_open_video(drive, out, config))
        tracking = files.enter_context(ObjectTracking(out, handover))
        try:
            for result in map(tracking.update, all_results):
                video.add(result, tracking.selected)
                append_frame(out, drive, result, pipeline.area, config.min_vehicle_score)
                summary.update(result, drive.point_truth(result.frame.index))
        except PerceptionError:
            log.warning("frames done: %d; their results are kept in %s", summary.frames, out)
            raise
        finally:
            results.close()
            summary.elapsed_s = time.perf_counter() - start
            write_json(out / "summary.json", {"sensor": drive.sensor.name, **summary.to_json()})
    if summary.frames:
        title = f"{drive.name}: a typical frame"
        plot_timeline(
            out / "timeline.png", title, summary.times.typical(), 1 / drive.sensor.rate_hz
        )
    return summary


class ObjectTracking:
    """Tracks one object of the pipeline from its first frame on, and writes its trajectory; or does nothing.

    Attributes:
        selected: The object in the last frame, or None before it appears.
    """

    def __init__(self, out: Path, handover: TrackHandover | None) -> None:
        """Start without the object.

        Args:
            out: Folder of the results, which gets `trajectory.jsonl`.
            handover: Tracker that waits for the object; None to track nothing.
        """
        self.selected: SelectedObject | None = None
        self._handover = handover
        self._path = out / "trajectory.jsonl"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        """Warn where the object never appeared."""
        if kind is None and self._handover is not None and not self._handover.has_started:
            log.warning(
                "--track %d: no frame has a track or a located vehicle of this id; tracks.jsonl and "
                "vehicles.jsonl hold the ids of this run",
                self._handover.track_id,
            )

    def update(self, result: Result) -> Result:
        """Track the object in one frame; return the frame with the time of the stage."""
        if self._handover is None:
            return result
        start_s = time.perf_counter()
        with limit_blas_threads():
            tracked = self._handover.update(result)
        seconds = time.perf_counter() - start_s
        if tracked is not None:
            track_id = self._handover.track_id
            append_record(self._path, TrajectoryRecord.of(result, tracked, track_id, None))
            self.selected = SelectedObject(track_id, tracked)
        return replace(result, timings_s={**result.timings_s, TRACKING_STAGE: seconds})


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
    tracker = single_object_tracker("default", drive.sensor)
    return TrackHandover(config.track, tracker, config.pipeline.ego_vehicle)
