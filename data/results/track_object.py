"""Track one object through a drive and write its trajectory."""

import logging
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from data.derived.track_start import TrackStart
from data.frames import frame_count, read_frames
from data.kitti.tracking_rows import format_result_rows
from data.results.documents import write_json
from data.results.folder import ResultsFolder, started
from data.results.kitti_rows import trajectory_rows
from data.results.objects import TrajectoryRecord
from data.results.records import append_record
from perception.atomic_file import append_atomically
from perception.evaluation.single_object.trajectory_summary import TrajectorySummary
from perception.geometry.boxes import points_inside
from perception.geometry.grids import EgoVehicle
from perception.geometry.threads import limit_blas_threads
from perception.pipeline import PipelineConfig
from perception.pipeline.lidar_stages import LidarStages
from perception.render.color_model_plots import ColorModelScene, plot_color_model
from perception.render.tracked_object_composition import TrackedObjectComposition
from perception.render.tracked_object_views import TrackedObjectScene
from perception.render.trails import TrackedObjectTrail
from perception.render.video import open_video
from perception.tracking.single_object.config import SingleObjectTrackerConfig
from perception.tracking.single_object.fusion.fusion_tracker import FusionTracker
from perception.tracking.single_object.handover import tracker_input_of
from perception.tracking.single_object.tracker import (
    SingleObjectTracker,
    TrackedObject,
)
from perception.tracking.single_object.trackers import single_object_tracker
from perception.types import Boxes3D, Drive, Frame, OnBadFrame, Result

log = logging.getLogger(__name__)

# Iterates over frames with a name and their number, and may show how many are done.
FrameProgress = Callable[[Iterable[Frame], str, int], Iterable[Frame]]


@dataclass(frozen=True)
class TrackConfig:
    """Configuration of the tracking of one object.

    Attributes:
        tracker: Name of the tracker.
        frames: Number of frames from the start frame; None for all.
        video: Whether the video is drawn.
        on_bad_frame: Stop at a damaged frame, or skip it.
        pipeline: Configuration of the stages before the tracker.
        tracker_config: Parameters of the trackers.
    """

    tracker: str = "default"
    frames: int | None = None
    video: bool = True
    on_bad_frame: OnBadFrame = "stop"
    pipeline: PipelineConfig = field(default_factory=lambda: PipelineConfig.for_motion("none"))
    tracker_config: SingleObjectTrackerConfig = field(default_factory=SingleObjectTrackerConfig)


def track_object(
    drive: Drive,
    start: TrackStart,
    folder: ResultsFolder,
    config: TrackConfig,
    progress: FrameProgress,
) -> TrajectorySummary:
    """Track one object; every result file is complete after each frame.

    Args:
        drive: Drive to track in.
        start: First box of the object.
        folder: Folder for the results; nothing is written before the tracker has started.
        config: Configuration of the tracking.
        progress: Shows the progress over the frames.

    Raises:
        PerceptionError: The tracker cannot start, or a frame cannot be used; the results before it stay.
    """
    calibration, rate_hz = drive.calibration, drive.sensor.rate_hz
    tracker = single_object_tracker(config.tracker, drive.sensor, config.tracker_config)
    last = frame_count(drive, None if config.frames is None else start.frame + config.frames)
    count = last - start.frame
    frames = read_frames(drive, on_bad_frame=config.on_bad_frame, limit=last, first=start.frame)
    stages = LidarStages(drive.sensor, config.pipeline)
    segmented = (stages.segment(frame)[0] for frame in progress(frames, drive.name, count))
    steps = started(_track(tracker, start, segmented, config.pipeline.ego_vehicle))
    out = folder.prepare()
    summary = TrajectorySummary(
        drive.name, config.tracker, start.name, out, start.truth, calibration
    )
    trail = TrackedObjectTrail()
    composition = TrackedObjectComposition(frame_count=count, name=start.name)
    with open_video(out / "video.mp4" if config.video else None, rate_hz) as video:
        try:
            for result, tracked, seconds in steps:
                if not summary.frames:
                    summary.points_at_start = _points_in(start.box_velo, result, config)
                identity = start.object_id, start.kind
                record = TrajectoryRecord.of(result, tracked, *identity)
                append_record(out / "trajectory.jsonl", record)
                if calibration is not None and calibration.image_size_px is not None:
                    rows = trajectory_rows(result.frame.number, tracked, *identity, calibration)
                    append_atomically(out / "trajectory.txt", format_result_rows(rows).encode())
                summary.update(result, tracked, seconds)
                if config.video:
                    trail.add(result, tracked)
                    scene = _scene(result, tracked, seconds, trail, start)
                    video.add(composition.draw(scene))
                if len(summary.frames) == 1 + count // 2:
                    _plot_colors(out / "color-model.png", start, result, tracked, tracker)
        finally:
            write_json(out / "summary.json", {"sensor": drive.sensor.name, **summary.to_json()})
    return summary


def _track(
    tracker: SingleObjectTracker,
    start: TrackStart,
    results: Iterable[Result],
    ego_vehicle: EgoVehicle,
) -> Iterator[tuple[Result, TrackedObject, float]]:
    """Yield each frame, the object in it, and the seconds that the tracker took."""
    is_first = True
    for result in results:
        tracker_input = tracker_input_of(result, ego_vehicle)
        start_s = time.perf_counter()
        with limit_blas_threads():
            tracked = (
                tracker.init(tracker_input, start.box_velo)
                if is_first
                else tracker.update(tracker_input)
            )
        yield result, tracked, time.perf_counter() - start_s
        is_first = False


def _scene(
    result: Result,
    tracked: TrackedObject,
    seconds: float,
    trail: TrackedObjectTrail,
    start: TrackStart,
) -> TrackedObjectScene:
    truth = None
    if start.truth is not None:
        truth = start.truth.boxes_velo[start.truth.frames == result.frame.index]
    return TrackedObjectScene(
        result=result,
        tracked=tracked,
        path_velo=trail.path_velo(result),
        ego_path_velo=trail.ego_path_velo(result),
        speeds_km_h=trail.speeds_km_h,
        states=trail.states,
        seconds=seconds,
        truth=truth if truth is not None and len(truth) else None,
    )


def _points_in(box_velo: Boxes3D, result: Result, config: TrackConfig) -> int:
    points_velo = tracker_input_of(result, config.pipeline.ego_vehicle).points_velo
    count = int(np.count_nonzero(points_inside(box_velo, points_velo)))
    if not count:
        log.warning("no point of the scan lies in the first box; the tracker starts from it alone")
    return count


def _plot_colors(
    path: Path,
    start: TrackStart,
    result: Result,
    tracked: TrackedObject,
    tracker: SingleObjectTracker,
) -> None:
    """Plot the colour model of the object (Fig. 5.16) where the tracker has one."""
    image = result.frame.image
    if not isinstance(tracker, FusionTracker) or image is None or tracked.region is None:
        return
    colors = tracker.colors
    scene = ColorModelScene(image, colors.regions, colors.measured, colors.colors.ratios)
    plot_color_model(path, f"Colours of {start.name} in frame {result.frame.index}", scene)
