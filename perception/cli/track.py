"""`trifuse track`: follow one object through a drive; its trajectory, its speed, and a video."""

import logging
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from data.frames import OnBadFrame, frame_count, read_frames
from data.open_drive import open_drive
from data.results.documents import write_config, write_json
from data.results.run_folder import make_results_folder
from data.results.trajectory import TrajectoryRecord, TrajectoryRows, trajectory_writer
from perception.cli.flags import require_positive
from perception.cli.progress import progress_bar
from perception.cli.track_start import TrackStart, TrackStartConfig, find_start
from perception.cli.track_summary import TrackSummary
from perception.evaluation.single_object.track import TrueTrack
from perception.geometry.boxes import points_inside
from perception.geometry.threads import limit_blas_threads
from perception.pipeline import PipelineConfig
from perception.pipeline.obstacle_chain import ObstacleChain
from perception.render.color_model_plots import ColorModelScene, plot_color_model
from perception.render.tracked_object_composition import TrackedObjectComposition
from perception.render.tracked_object_views import TrackedObjectScene
from perception.render.trails import TrackedObjectTrail
from perception.render.video import VideoSink, open_video
from perception.sensor import LidarModel
from perception.tracking.single_object.fusion.fusion_tracker import FusionTracker
from perception.tracking.single_object.fusion.image_region import ImageRegion
from perception.tracking.single_object.handover import tracker_input_of
from perception.tracking.single_object.tracker import (
    SingleObjectTracker,
    TrackedObject,
    TrackerInput,
)
from perception.tracking.single_object.trackers import TRACKERS, single_object_tracker
from perception.types import Boxes3D, Drive, Result

log = logging.getLogger(__name__)

TrackerFactory = Callable[[str, LidarModel], SingleObjectTracker]


def track(  # noqa: PLR0913 - flags of a command
    drive: Path,
    *,
    track_id: int | None = None,
    box: str | None = None,
    sequence: str | None = None,
    start_frame: int | None = None,
    frames: int | None = None,
    tracker: str = TRACKERS[0],
    out: Path | None = None,
    sensor: str | None = None,
    video: bool = True,
    on_bad_frame: OnBadFrame = "stop",
) -> None:
    """Follow one object through a drive, by LiDAR and camera; write its trajectory, speed and box, and a video.

    Example: trifuse track kitti/tracking --sequence 0000 --track-id 1 --out results/cyclist

    Args:
        drive: a KITTI raw drive, a tracking folder, or a synthetic drive.
        track_id: the labelled object to follow, from its first label on, and to be compared with.
        box: or its box as x,y,z,length,width,height,yaw, in metres and radians: x y z is the middle of the
            bottom in the LiDAR frame of the start frame. Write --box=-5,... where the first is negative.
        sequence: which one, where there are several.
        start_frame: in which the object is; else the first.
        frames: only so many from there; else all.
        tracker: default, h-fus, l-fus, 3d-ms, 3d-kf, or, in the image alone, ms-i, cbwh, opencv-kcf,
            opencv-csrt, opencv-mil.
        out: folder for the results; else results/<time>, with results/latest pointing to it.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        video: whether to draw the video.
        on_bad_frame: stop at a damaged frame, keeping what was done, or skip it and say so.
    """
    start_config = TrackStartConfig(track_id, box, start_frame)
    plan = TrackConfig(tracker, frames, video, on_bad_frame)
    opened = open_drive(drive, sequence=sequence, sensor=sensor)
    start = find_start(opened, start_config)
    summary = track_object(opened, start, out or make_results_folder(), plan)
    print(summary.table(opened.calibration))


@dataclass(frozen=True)
class TrackConfig:
    """How an object is followed.

    Attributes:
        tracker: name of the tracker.
        frames: only so many, or None.
        video: whether to draw the video.
        on_bad_frame: stop or skip.
        pipeline: what comes before the tracker.
        make: a tracker of a name.
    """

    tracker: str = TRACKERS[0]
    frames: int | None = None
    video: bool = True
    on_bad_frame: OnBadFrame = "stop"
    pipeline: PipelineConfig = field(default_factory=lambda: PipelineConfig.for_motion("none"))
    make: TrackerFactory = single_object_tracker

    def __post_init__(self) -> None:
        """Refuse to follow through no frames."""
        require_positive("--frames", self.frames)


def track_object(drive: Drive, start: TrackStart, out: Path, plan: TrackConfig) -> TrackSummary:
    """Follow one object and write what becomes of it, whole at every moment.

    Raises:
        PerceptionError: the tracker cannot begin, or a frame cannot be used; what was done before it stays.
    """
    timed_tracker = _TimedTracker(plan.make(plan.tracker, drive.sensor), start)
    summary = TrackSummary(drive.name, plan.tracker, start, out)
    last = frame_count(drive, None if plan.frames is None else start.frame + plan.frames)
    renderer = _VideoRenderer(start, last - start.frame)
    chain = ObstacleChain(drive.sensor, plan.pipeline)
    frames = read_frames(drive, on_bad_frame=plan.on_bad_frame, limit=last, first=start.frame)
    shown = progress_bar(frames, drive.name, last - start.frame)
    with ExitStack() as files:
        lines = files.enter_context(trajectory_writer(out))
        rows = files.enter_context(
            closing(
                TrajectoryRows(
                    out / "trajectory.txt", drive.calibration, start.object_id, start.kind
                )
            )
        )
        write_config(
            out,
            drive,
            object={"name": start.name, "start_frame": start.frame, "box_velo": start.box_velo},
            plan={name: value for name, value in vars(plan).items() if name != "make"},
        )
        path = out / "video.mp4" if plan.video else None
        video = files.enter_context(open_video(path, drive.sensor.rate_hz))
        try:
            for frame in shown:
                result, _ = chain.segment(frame)
                tracker_input = tracker_input_of(result, plan.pipeline.ego_vehicle)
                timed = timed_tracker.update(tracker_input)
                if not summary.frames:
                    summary.points_at_start = _points_in(start.box_velo, tracker_input)
                lines.write(TrajectoryRecord.of(result, timed.tracked))
                rows.write(result, timed.tracked)
                summary.add(result, timed.tracked, timed.seconds)
                if plan.video:
                    renderer.add(video, result, timed)
                if len(summary.frames) == 1 + (last - start.frame) // 2:
                    _plot_colors(out / "color-model.png", start, result, timed_tracker.tracker)
        finally:
            write_json(out / "summary.json", summary.to_json(drive.calibration))
    return summary


def _points_in(box_velo: Boxes3D, tracker_input: TrackerInput) -> int:
    count = int(np.count_nonzero(points_inside(box_velo, tracker_input.points_velo)))
    if not count:
        log.warning("no point of the scan lies in the first box; the tracker goes on from it alone")
    return count


def _plot_colors(
    path: Path, start: TrackStart, result: Result, tracker: SingleObjectTracker
) -> None:
    """Draw what a tracker that looks at colours knows of them (Fig. 5.16); nothing of another."""
    path.unlink(missing_ok=True)
    image, region = result.frame.image, region_of_tracker(tracker)
    if not isinstance(tracker, FusionTracker) or image is None or region is None:
        return
    scene = ColorModelScene(
        image=image,
        regions=tracker.colors.regions or (region,),
        measured=tracker.colors.measured,
        filtered=tracker.colors.colors.ratios,
    )
    plot_color_model(path, f"Colours of {start.name} in frame {result.frame.index}", scene)


@dataclass(frozen=True)
class _TimedObject:
    """What a tracker says of one frame, how long it took, and where it looks in the image."""

    tracked: TrackedObject
    seconds: float
    region: ImageRegion | None


class _TimedTracker:
    """A tracker with a clock."""

    def __init__(self, tracker: SingleObjectTracker, start: TrackStart) -> None:
        self.tracker, self._start = tracker, start
        self._is_initialized = False

    def update(self, tracker_input: TrackerInput) -> _TimedObject:
        """Begin, or go on."""
        start_s = time.perf_counter()
        with limit_blas_threads():
            if self._is_initialized:
                tracked = self.tracker.update(tracker_input)
            else:
                tracked = self.tracker.init(tracker_input, self._start.box_velo)
        self._is_initialized = True
        return _TimedObject(tracked, time.perf_counter() - start_s, region_of_tracker(self.tracker))


def region_of_tracker(tracker: SingleObjectTracker) -> ImageRegion | None:
    """Return where a tracker last saw the object's colours, or None of one that does not look at them."""
    return tracker.colors.region if isinstance(tracker, FusionTracker) else None


class _VideoRenderer:
    """Draws the video, remembering where the object was."""

    def __init__(self, start: TrackStart, frame_count: int) -> None:
        self._trail, self._truth = TrackedObjectTrail(), start.truth
        self._composition = TrackedObjectComposition(frame_count=frame_count, name=start.name)

    def add(self, video: VideoSink, result: Result, timed: _TimedObject) -> None:
        """Draw one frame."""
        self._trail.add(result, timed.tracked)
        scene = TrackedObjectScene(
            result=result,
            tracked=timed.tracked,
            path_velo=self._trail.path_velo(result),
            ego_path_velo=self._trail.ego_path_velo(result),
            speeds_km_h=self._trail.speeds_km_h,
            states=self._trail.states,
            seconds=timed.seconds,
            region=timed.region,
            truth=_true_box(self._truth, result.frame.index),
        )
        video.add(self._composition.draw(scene))


def _true_box(truth: TrueTrack | None, frame: int) -> Boxes3D | None:
    if truth is None:
        return None
    rows = np.flatnonzero(truth.frames == frame)
    return truth.boxes_velo[rows] if len(rows) else None
