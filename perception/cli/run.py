"""`trifuse run`: every stage on a drive, its results in a folder, its summary on the screen."""

import logging
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from data.frames import OnBadFrame, frame_count
from data.open_drive import open_drive
from data.results.documents import write_config
from data.results.run_folder import RunFolderWriter, make_results_folder
from perception.cli.drive_results import drive_results
from perception.cli.flags import require_positive
from perception.cli.run_summary import RunSummary
from perception.cli.run_video import NoRunVideo, RunVideo, RunVideoWriter
from perception.cli.track_handover import HandoverTracking, NoObjectTracking, ObjectTracking
from perception.errors import PerceptionError
from perception.pipeline import PipelineConfig
from perception.pipeline.detection_chain import enabled_modalities
from perception.render.bar_plots import plot_timeline
from perception.render.composition import Composition
from perception.tracking.single_object.handover import TrackHandover
from perception.tracking.single_object.trackers import TRACKERS, single_object_tracker
from perception.types import Drive

log = logging.getLogger(__name__)


def run(  # noqa: PLR0913 - flags of a command
    drive: Path,
    *,
    out: Path | None = None,
    sequence: str | None = None,
    sensor: str | None = None,
    frames: int | None = None,
    video: bool = True,
    follow: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
    pipeline: PipelineConfig = PipelineConfig(),  # noqa: B008 - frozen
) -> None:
    """Find ground and obstacles in every frame of a drive, and follow what moves.

    Example: trifuse run 2011_09_26/2011_09_26_drive_0005_sync --out results/0005

    Args:
        drive: a KITTI raw drive, tracking folder, object folder, or synthetic drive.
        out: folder for the results; else results/<time>, with results/latest pointing to it.
        sequence: which one, where there are several.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        frames: only so many from the start; else all.
        video: whether to draw the video.
        follow: id of a track or a detected vehicle that the default tracker of one object takes over in the
            first frame in which it has a box.
        on_bad_frame: stop at a damaged frame, keeping what was done, or skip it and say so.
        pipeline: choices of the pipeline; --pipeline.method thesis for the thesis' own.
    """
    # Networks, and a tracker of one object, look at images that nobody draws.
    needs_images = "rgb" in enabled_modalities(pipeline.detection) or follow is not None
    opened = open_drive(drive, sequence=sequence, sensor=sensor, images=video or needs_images)
    plan = RunConfig(frames, video, on_bad_frame, pipeline, follow)
    summary = run_drive(opened, out or make_results_folder(), plan)
    print(summary.table())


@dataclass(frozen=True)
class RunConfig:
    """How a drive is run.

    Attributes:
        frames: only so many from the start, or None.
        video: whether to draw the video.
        on_bad_frame: stop or skip.
        pipeline: choices of the pipeline.
        follow: id of the track or vehicle that is followed by itself, or None.
    """

    frames: int | None = None
    video: bool = True
    on_bad_frame: OnBadFrame = "stop"
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    follow: int | None = None

    def __post_init__(self) -> None:
        """Refuse a run of no frames."""
        require_positive("--frames", self.frames)


def run_drive(drive: Drive, out: Path, plan: RunConfig) -> RunSummary:
    """Run the pipeline over a drive and write its results, whole at every moment.

    Raises:
        PerceptionError: a frame cannot be used; what was done before it stays in the folder.
    """
    area = plan.pipeline.area
    summary = RunSummary(drive.name, out)
    results = drive_results(drive, plan.pipeline, limit=plan.frames, on_bad_frame=plan.on_bad_frame)
    start = time.perf_counter()
    with ExitStack() as files:
        folder = files.enter_context(RunFolderWriter(out, drive, area))
        write_config(out, drive, plan=plan)
        video_writer = files.enter_context(_video_writer(drive, out, plan))
        object_tracking = files.enter_context(_object_tracking(drive, out, plan))
        try:
            for result in map(object_tracking.update, results):
                video_writer.add(result, object_tracking)
                folder.write(result)
                summary.add(result, drive.point_truth(result.frame.index), area)
        except PerceptionError:
            log.warning("%d frames were done before this; they are in %s", summary.frames, out)
            raise
        finally:
            results.close()
            summary.elapsed_s = time.perf_counter() - start
            folder.write_summary(summary.to_json())
    if summary.frames:
        title = f"{drive.name}: a typical frame"
        spans, turn_s = summary.times.typical(), 1 / drive.sensor.rate_hz
        plot_timeline(out / "timeline.png", title, spans, turn_s)
    return summary


def _video_writer(drive: Drive, out: Path, plan: RunConfig) -> RunVideo:
    """Return who draws what a plan wants drawn."""
    if not plan.video:
        return NoRunVideo()
    composition = Composition(area=plan.pipeline.area, turn_s=1 / drive.sensor.rate_hz)
    return RunVideoWriter(out, drive, composition, frame_count(drive, plan.frames))


def _object_tracking(drive: Drive, out: Path, plan: RunConfig) -> ObjectTracking:
    """Return who follows the object of a plan, or nobody."""
    if plan.follow is None:
        return NoObjectTracking()
    tracker = single_object_tracker(TRACKERS[0], drive.sensor)
    handover = TrackHandover(plan.follow, tracker, plan.pipeline.ego_vehicle)
    return HandoverTracking(out, handover)
