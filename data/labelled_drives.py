"""Labelled drives as an evaluation opens and reads them: one drive, or every sequence of a set."""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from data.derived.motion_labels import evaluation_labels
from data.derived.obstacle_sequences import SequenceSet, find_sequences
from data.faults.injection import Fault
from data.layouts import OpenConfig
from data.open_drive import open_drive
from data.pipeline_results import FrameProgress, no_progress, pipeline_results
from data.recorded_drive import RecordedDrive
from data.results.evaluated import EvaluatedDrive, EvaluatedSet
from data.splits.files import select_part
from data.splits.parts import Part
from perception.errors import DriveError, UsageError
from perception.evaluation.report import Measure, Report
from perception.pipeline import PipelineConfig
from perception.types import Drive, OnBadFrame, Result

OneReport = TypeVar("OneReport", bound=Report)
_READING = OpenConfig()


@dataclass(frozen=True)
class LabelledDrives:
    """How labelled drives are opened and read.

    Attributes:
        sequence: Sequence of a tracking folder; else each of them where several are taken.
        reading: How each drive is read.
        frames: Number of frames from the start of each drive; else all.
        on_bad_frame: Stop at a damaged frame, or skip it.
        split: Split file of which one part is read; else all frames.
        part: Part of the split; test where none is named.
        progress: Shows a progress bar over frames with a description and their number.
    """

    sequence: str | None = None
    reading: OpenConfig = _READING
    frames: int | None = None
    on_bad_frame: OnBadFrame = "stop"
    split: Path | None = None
    part: Part | None = None
    progress: FrameProgress = no_progress

    def select(self, drives: Sequence[RecordedDrive]) -> list[RecordedDrive]:
        """Return the drives with the frames of the part, or as they are without a split.

        Raises:
            UsageError: The split is damaged, of other drives, or has no frame of them in the part.
            DriveError: A drive lacks a frame of the part.
        """
        return select_part(drives, self.split, self.part or "test")

    def open(self, root: Path, *, images: bool = False) -> RecordedDrive:
        """Open a drive that has labels or exact truth to measure against.

        Args:
            root: Folder of the drive.
            images: Whether frames carry images.

        Raises:
            DriveError: The path holds no such drive.
            UsageError: The part holds no frame of the drive, or some frames of a sequence.
        """
        drive = open_drive(root, sequence=self.sequence, config=self.reading, images=images)
        if not (drive.has_labels or drive.has_point_truth):
            raise DriveError(
                drive.root,
                expected="labelled boxes or exact point truth to measure against",
                found="neither in this drive",
                advice="name `labels` in the drive.yaml of a folder, or take the tracking or object layout",
            )
        (selected,) = self.select([drive])
        if drive.is_sequence and len(selected) < len(drive):
            raise UsageError(
                f"--split {self.split}",
                expected=f"all {len(drive)} frames of {drive.name} in one part, as they follow each other",
                found=f"{len(selected)} of them",
                advice="split with --by drives",
            )
        return selected

    def results(
        self, drive: Drive, pipeline: PipelineConfig, faults: Sequence[Fault] = ()
    ) -> Generator[Result, None, None]:
        """Yield the results of the pipeline over a drive."""
        return pipeline_results(
            drive,
            pipeline,
            limit=self.frames,
            on_bad_frame=self.on_bad_frame,
            faults=faults,
            progress=self.progress,
        )

    def evaluate(
        self, drive: Drive, pipeline: PipelineConfig, measure: Measure[OneReport]
    ) -> tuple[EvaluatedDrive, OneReport]:
        """Run the pipeline over a drive and update a measure with every frame; return frames and metrics.

        Raises:
            PerceptionError: A frame cannot be read or used.
        """
        count = 0
        for result in self.results(drive, pipeline):
            count += 1
            index = result.frame.index
            measure.update(result, evaluation_labels(drive, index), drive.point_truth(index))
        return EvaluatedDrive.of(drive, self.frames, count), measure.compute()

    def evaluate_set(
        self,
        root: Path,
        set: SequenceSet | None,
        evaluate: Callable[[Drive], tuple[EvaluatedDrive, OneReport]],
        combine: Callable[[Mapping[str, OneReport]], Report],
    ) -> tuple[EvaluatedDrive | EvaluatedSet, Report]:
        """Evaluate one drive, or every sequence of a set that a folder holds.

        Args:
            root: Folder of a drive, or of tracking sequences.
            set: Name of the set, or None for one drive.
            evaluate: Function that returns the frames and the metrics of a drive.
            combine: Function that returns the metrics of a set, of those of its sequences by name.

        Returns:
            Evaluated frames, and the metrics.

        Raises:
            DriveError: The folder holds no sequence of the set.
            PerceptionError: A frame cannot be read or used.
        """
        if set is None:
            return evaluate(self.open(root))
        present, absent = find_sequences(root, set, self.sequence)
        # All are opened before the first is evaluated, which takes minutes.
        opened = {one.name: replace(self, sequence=one.sequence).open(root) for one in present}
        evaluated = {name: evaluate(drive) for name, drive in opened.items()}
        drives: dict[str, Any] = {name: data for name, (data, _) in evaluated.items()}
        reports = {name: report for name, (_, report) in evaluated.items()}
        names = [one.name for one in absent]
        return EvaluatedSet(root.resolve(), set, drives, names), combine(reports)
