"""`trifuse run`."""

from dataclasses import dataclass
from pathlib import Path

from data.exports.run_exports import RunExports
from data.results.command_config import CommandConfig
from perception.cli.flags import DriveFlags, ResultsFlags
from perception.cli.parser import FlagGroup
from perception.pipeline import PipelineConfig
from perception.tracking.single_object.config import SingleObjectTrackerConfig, TrackerName

_PIPELINE = PipelineConfig()
_TRACKER_CONFIG = SingleObjectTrackerConfig()


@dataclass(frozen=True)
class ExportFlags(RunExports, FlagGroup):
    """Exports."""


def run(
    drive: Path,
    *,
    frames: DriveFlags,
    results: ResultsFlags,
    exports: ExportFlags,
    config: CommandConfig,
    video: bool = True,
    video_views: bool = False,
    track: int | None = None,
    tracker: TrackerName = "default",
    min_vehicle_score: float = 0.05,
    tracker_config: SingleObjectTrackerConfig = _TRACKER_CONFIG,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Run the pipeline on a drive; write ground, obstacles, tracks, vehicles, and a video.

    Example: trifuse run 2011_09_26/2011_09_26_drive_0005_sync --out results/0005

    Args:
        drive: Folder or file of a drive in any layout.
        video: Draw the video.
        video_views: Draw the boxes of each modality's detector in the video, too.
        track: Id of a track or detected vehicle that a one-object tracker takes over.
        tracker: Name of the one-object tracker; ms-i, cbwh and opencv-* work in the image alone.
        min_vehicle_score: Score from which a detected vehicle is listed in vehicles.jsonl; 0 for all.
        tracker_config: Parameters of the one-object trackers.
        pipeline: Pipeline configuration.
    """
    from data.open_drive import open_drive
    from data.results.run_config import RunConfig
    from data.results.run_drive import run_drive
    from perception.cli.drive_results import drive_results
    from perception.detection.networks import enabled_modalities

    # The RGB detector and the one-object tracker read images that no video needs.
    images = video or track is not None or "rgb" in enabled_modalities(pipeline.detection)
    opened = open_drive(drive, sequence=frames.sequence, config=frames.reading, images=images)
    run_config = RunConfig(
        frames=frames.frames,
        video=video,
        video_views=video_views,
        pipeline=pipeline,
        track=track,
        tracker=tracker,
        tracker_config=tracker_config,
        min_vehicle_score=min_vehicle_score,
        exports=exports,
    )
    folder = results.folder(config)
    found = drive_results(opened, pipeline, limit=frames.frames, on_bad_frame=frames.on_bad_frame)
    print(run_drive(opened, found, folder, run_config).text())
