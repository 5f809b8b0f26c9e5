"""`trifuse run`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from data.exports.run_exports import RunExports
from data.results.command_config import CommandConfig
from perception.cli.flags import PartOfDriveFlags, ResultsFlags
from perception.cli.parser import FlagGroup
from perception.errors import UsageError
from perception.pipeline import PipelineConfig
from perception.tracking.single_object.config import SingleObjectTrackerConfig, TrackerName

if TYPE_CHECKING:
    from data.results.stopped_run import StoppedRun

_PIPELINE = PipelineConfig()
_TRACKER_CONFIG = SingleObjectTrackerConfig()


@dataclass(frozen=True)
class ExportFlags(RunExports, FlagGroup):
    """Exports."""


@dataclass(frozen=True)
class RunResultsFlags(ResultsFlags):
    """Results.

    Attributes:
        resume: Resume the stopped run of the same configuration in that folder, by default in results/latest.
        checkpoint_frames: Number of frames between two checkpoints, from which --resume continues; 0 for none.
    """

    resume: bool = False
    checkpoint_frames: int = 200

    def __post_init__(self) -> None:
        """Validate that results are gone on with or replaced, and not both."""
        if self.resume and self.overwrite:
            raise UsageError("--resume", expected="no --overwrite beside it", found="both")

    def place(self, config: CommandConfig) -> "StoppedRun":
        """Return the folder of the results, with what a stopped run left in it."""
        from data.results.stopped_run import StoppedRun

        is_new = not self.resume
        return (
            StoppedRun(self.folder(config), None) if is_new else StoppedRun.find(self.out, config)
        )


def run(
    drive: Path,
    *,
    frames: PartOfDriveFlags,
    results: RunResultsFlags,
    exports: ExportFlags,
    config: CommandConfig,
    video: bool = True,
    video_views: bool = False,
    track: int | None = None,
    tracker: TrackerName = "default",
    min_vehicle_score: float = 0.05,
    fault: tuple[str, ...] = (),
    fault_seed: int = 0,
    stages: bool = False,
    tracker_config: SingleObjectTrackerConfig = _TRACKER_CONFIG,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Run the pipeline on a drive; write ground, obstacles, tracks, vehicles, and a video.

    Example: trifuse run 2011_09_26/2011_09_26_drive_0005_sync --out results/0005

    Args:
        drive: Folder or file of a drive in any layout.
        video: Draw the video.
        video_views: Also draw the boxes of each modality's detector in the video.
        track: Id of a track or detected vehicle that a one-object tracker takes over.
        tracker: Name of the one-object tracker; ms-i, cbwh and opencv-* work in the image alone.
        min_vehicle_score: Score from which a detected vehicle is listed in vehicles.jsonl; 0 for all.
        fault: Faults of sensors to inject, as KIND:FIRST-LAST or KIND:FIRST-LAST:SIZE, such as camera-dark:50-80.
        fault_seed: Seed of the injected faults.
        stages: Also print the time of each stage, which summary.json always holds.
        tracker_config: Parameters of the one-object trackers.
        pipeline: Pipeline configuration.
    """
    from data.faults.injection import Fault
    from data.open_drive import open_drive
    from data.results.drive_run import DriveRun
    from data.results.run_config import RunConfig
    from perception.cli.progress import compile_functions, frame_progress_bar, progress_bar
    from perception.detection.networks import detectors_note

    # The RGB detector and the one-object tracker read images that no video needs.
    images = video or track is not None or "rgb" in (pipeline.detection.modalities or ("rgb",))
    faults = [Fault.parse(text, fault_seed) for text in fault]
    opened = open_drive(drive, sequence=frames.sequence, config=frames.reading, images=images)
    print(detectors_note(pipeline.detection, opened.sensor, pipeline.method))
    run_config = RunConfig(
        frames.frames, video, video_views, pipeline=pipeline, track=track, tracker=tracker,
        tracker_config=tracker_config, min_vehicle_score=min_vehicle_score, exports=exports,
    )  # fmt: skip
    place, bar = results.place(config), frame_progress_bar("report")
    compile_functions()
    every, skips = results.checkpoint_frames, frames.on_bad_frame
    run = DriveRun(opened, run_config, skips, every, faults, progress_bar, bar)
    print(run.write(place).text(stages=stages))
