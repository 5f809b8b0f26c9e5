"""A run of the pipeline over a drive, from its frames to its files."""

from collections.abc import Sequence
from dataclasses import dataclass

from data.faults.injection import Fault
from data.pipeline_results import FrameProgress, no_progress, pipeline_results
from data.results.run_config import RunConfig
from data.results.run_drive import run_drive
from data.results.stopped_run import StoppedRun
from perception.evaluation.run_summary import RunSummary
from perception.types import Drive, OnBadFrame, Progress


@dataclass(frozen=True)
class DriveRun:
    """A run that starts, or goes on where it was stopped.

    Attributes:
        drive: Drive of the run.
        config: Configuration of the run.
        on_bad_frame: Stop at a damaged frame, or skip it.
        checkpoint_frames: Number of frames between two checkpoints; 0 for none.
        faults: Faults of sensors that are injected.
        progress: Progress bar over the frames.
        report_progress: Progress bar of what is written at the end.
    """

    drive: Drive
    config: RunConfig
    on_bad_frame: OnBadFrame = "stop"
    checkpoint_frames: int = 200
    faults: Sequence[Fault] = ()
    progress: FrameProgress = no_progress
    report_progress: Progress = iter

    def write(self, place: StoppedRun) -> RunSummary:
        """Run the pipeline, and write its results into a folder.

        Args:
            place: Folder of the results, and the checkpoint to go on from.

        Raises:
            PerceptionError: A frame cannot be used; the results of the frames before it stay.
        """
        found = pipeline_results(
            self.drive,
            self.config.pipeline,
            limit=self.config.frames,
            on_bad_frame=self.on_bad_frame,
            checkpoint=place.checkpoint,
            checkpoint_frames=self.checkpoint_frames,
            faults=self.faults,
            progress=self.progress,
        )
        return run_drive(
            self.drive, found, place.folder, self.config, place.checkpoint, self.report_progress
        )
