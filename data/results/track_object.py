"""Track one object through a drive and write its trajectory."""

import logging
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from data.derived.track_start import TrackStart
from data.frames import frame_count, frame_period_s, read_frames
from data.kitti.tracking_rows import format_result_rows
from data.results.documents import write_json
from data.results.folder import ResultsFolder, started
from data.results.kitti_rows import trajectory_rows
from data.results.objects import TrajectoryRecord
from data.results.records import append_record
from perception.atomic_file import append_atomically, write_jpeg
from perception.evaluation.single_object.trajectory_summary import TrajectorySummary
from perception.geometry.boxes import points_inside
from perception.geometry.threads import limit_blas_threads
from perception.pipeline import PipelineConfig
from perception.pipeline.lidar_stages import LidarStages
from perception.render.color_model_plots import ColorModelScene, plot_color_model
from perception.render.localization_plots import (
    GroundRemovalScene,
    PointMeanShiftScene,
    plot_ground_removal,
    plot_point_mean_shift,
)
from perception.render.tracked_object_composition import TrackedObjectComposition
from perception.render.tracked_object_views import TrackedObjectScene
from perception.render.trails import TrackedObjectTrail
from perception.render.video import open_video
from perception.tracking.single_object.centroid_tracker import CentroidTracker
from perception.tracking.single_object.config import SingleObjectTrackerConfig
from perception.tracking.single_object.fusion.fusion_tracker import FusionTracker
from perception.tracking.single_object.handover import tracker_input_of
from perception.tracking.single_object.pitch_ground import PitchedPlane
from perception.tracking.single_object.tracker import SingleObjectTracker
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
        plots: Whether the figures of the frame in the middle are drawn.
        on_bad_frame: Stop at a damaged frame, or skip it.
        pipeline: Configuration of the stages before the tracker.
        tracker_config: Parameters of the trackers.
    """

    tracker: str = "default"
    frames: int | None = None
    video: bool = True
    plots: bool = False
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
    calibration, rate_hz = drive.calibration, 1 / frame_period_s(drive)
    tracker = single_object_tracker(config.tracker, drive.sensor, config.tracker_config)
    count = _last_frame(drive, start, config) - start.frame
    scenes = started(tracked_scenes(drive, start, tracker, config, progress))
    out = folder.prepare()
    summary = TrajectorySummary(
        drive.name, config.tracker, start.name, out, start.truth, calibration
    )
    composition = TrackedObjectComposition(frame_count=count, name=start.name)
    with open_video(out / "video.mp4" if config.video else None, rate_hz) as video:
        try:
            for scene in scenes:
                result, tracked = scene.result, scene.tracked
                if not summary.frames:
                    summary.points_at_start = _points_in(start.box_velo, result, config)
                identity = start.object_id, start.kind
                record = TrajectoryRecord.of(result, tracked, *identity)
                append_record(out / "trajectory.jsonl", record)
                if calibration is not None and calibration.image_size_px is not None:
                    rows = trajectory_rows(result.frame.number, tracked, *identity, calibration)
                    append_atomically(out / "trajectory.txt", format_result_rows(rows).encode())
                summary.update(result, tracked, scene.seconds)
                if config.video:
                    video.add(composition.draw(scene))
                if config.plots and len(summary.frames) == 1 + count // 2:
                    write_jpeg(out / "preview.jpg", composition.draw(scene), quality=88)
                    plot_tracker(out, f"{start.name}, frame {result.frame.index}", tracker, scene)
        finally:
            write_json(out / "summary.json", {"sensor": drive.sensor.name, **summary.to_json()})
    return summary


def tracked_scenes(
    drive: Drive,
    start: TrackStart,
    tracker: SingleObjectTracker,
    config: TrackConfig,
    progress: FrameProgress,
) -> Iterator[TrackedObjectScene]:
    """Yield each frame from the start on, with the object in it.

    Args:
        drive: Drive to track in.
        start: First box of the object.
        tracker: New tracker.
        config: Configuration of the tracking.
        progress: Shows the progress over the frames.

    Raises:
        PerceptionError: The tracker cannot start, or a frame cannot be used.
    """
    last = _last_frame(drive, start, config)
    frames = read_frames(drive, on_bad_frame=config.on_bad_frame, limit=last, first=start.frame)
    stages, trail = LidarStages(drive.sensor, config.pipeline), TrackedObjectTrail()
    for frame in progress(frames, drive.name, last - start.frame):
        result, _ = stages.segment(frame)
        tracker_input = tracker_input_of(result, config.pipeline.ego_vehicle)
        start_s = time.perf_counter()
        with limit_blas_threads():
            tracked = (
                tracker.update(tracker_input)
                if trail.states
                else tracker.init(tracker_input, start.box_velo)
            )
        seconds = time.perf_counter() - start_s
        trail.add(result, tracked)
        yield TrackedObjectScene(
            result=result,
            tracked=tracked,
            path_velo=trail.path_velo(result),
            ego_path_velo=trail.ego_path_velo(result),
            speeds_km_h=trail.speeds_km_h,
            states=trail.states,
            seconds=seconds,
            truth=_true_box(start, frame.index),
        )


def _last_frame(drive: Drive, start: TrackStart, config: TrackConfig) -> int:
    """Return the index behind the last frame."""
    return frame_count(drive, None if config.frames is None else start.frame + config.frames)


def _true_box(start: TrackStart, frame: int) -> Boxes3D | None:
    """Return the labelled box in a frame, or None without one."""
    if start.truth is None:
        return None
    box = start.truth.boxes_velo[start.truth.frames == frame]
    return box if len(box) else None


def _points_in(box_velo: Boxes3D, result: Result, config: TrackConfig) -> int:
    points_velo = tracker_input_of(result, config.pipeline.ego_vehicle).points_velo
    count = int(np.count_nonzero(points_inside(box_velo, points_velo)))
    if not count:
        log.warning("no point of the scan lies in the first box; the tracker starts from it alone")
    return count


def plot_tracker(
    folder: Path, title: str, tracker: SingleObjectTracker, scene: TrackedObjectScene
) -> None:
    """Plot the stages that a tracker has: ground (Fig. 5.14), mean shift (5.15), colour model (5.16).

    Args:
        folder: Folder for the figures.
        title: Object and frame.
        tracker: Tracker after the frame.
        scene: Object in the frame.
    """
    if isinstance(tracker, CentroidTracker):
        _plot_localization(folder, title, tracker, scene)
    image, region = scene.result.frame.image, scene.tracked.region
    if isinstance(tracker, FusionTracker) and image is not None and region is not None:
        colors = tracker.colors
        model = ColorModelScene(image, colors.regions, colors.measured, colors.colors.ratios)
        plot_color_model(folder / "color-model.png", f"Colours of {title}", model)


def _plot_localization(
    folder: Path, title: str, tracker: CentroidTracker, scene: TrackedObjectScene
) -> None:
    found, box_velo = tracker.localizer_input, scene.tracked.box_velo
    if found is None or box_velo is None:
        return
    if isinstance(found.ground, PitchedPlane):
        removal = GroundRemovalScene(
            found.tracker_input.points_velo,
            found.ground,
            tracker.pitch.gate_rad,
            tracker.config.pitch,
            tracker.config.min_height_m,
            box_velo,
            found.tracker_input.image,
            found.tracker_input.image_P_velo,
        )
        plot_ground_removal(folder / "ground.png", f"Ground below {title}", removal)
    if tracker.localizer.windows:
        shift = PointMeanShiftScene(
            found.obstacles.points_world, tracker.localizer.windows, float(box_velo.size_m[0, 2])
        )
        plot_point_mean_shift(folder / "mean-shift.png", f"Mean shift to {title}", shift)
