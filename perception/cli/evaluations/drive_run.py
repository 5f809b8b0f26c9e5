"""One drive through the pipeline, to be measured."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from data.frames import OnBadFrame, frame_count
from data.open_drive import open_drive
from perception.cli.drive_results import drive_results
from perception.cli.evaluations.document import DatasetInfo, Evaluation, write_evaluation
from perception.cli.flags import require_positive
from perception.errors import DriveError
from perception.pipeline import PipelineConfig
from perception.types import Drive, Result


@dataclass(frozen=True)
class DriveRun:
    """One drive through the pipeline.

    Attributes:
        drive: what is evaluated.
        config: of the pipeline.
        limit: only so many frames from the start, or None.
        on_bad_frame: stop or skip.
    """

    drive: Drive
    config: PipelineConfig
    limit: int | None
    on_bad_frame: OnBadFrame

    def results(self) -> Iterator[Result]:
        """Yield what the pipeline makes of each frame."""
        return drive_results(
            self.drive, self.config, limit=self.limit, on_bad_frame=self.on_bad_frame
        )

    def describe(self, evaluated: int) -> str:
        """Name what was evaluated."""
        return (
            f"{self.drive.name}: {evaluated} of {len(self.drive)} frames, "
            f"{self.drive.sensor.name}, method {self.config.method}"
        )

    def write(self, path: Path, evaluated: int, evaluation: Evaluation) -> None:
        """Write the figures and all that one needs to get them again."""
        data = DatasetInfo(
            root=self.drive.root.resolve(),
            drive=self.drive.name,
            sensor=self.drive.sensor.name,
            frames=len(self.drive),
            first_frames=frame_count(self.drive, self.limit),
            frames_evaluated=evaluated,
        )
        write_evaluation(path, data, self.config, evaluation)


def open_labelled_drive(
    root: Path, sequence: str | None, sensor: str | None, frames: int | None
) -> Drive:
    """Open a drive that has something to measure against."""
    require_positive("--frames", frames)
    drive = open_drive(root, sequence=sequence, sensor=sensor, images=False)
    if not drive.has_labels and drive.point_truth(0) is None:
        raise DriveError(
            drive.root,
            expected="labelled boxes or exact point truth to measure against",
            found="neither in this drive",
            advice="name the same drive in the tracking or object layout, or one that "
            "`trifuse synth` wrote",
        )
    return drive
