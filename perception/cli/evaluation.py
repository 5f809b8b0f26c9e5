"""Evaluation of a measure over a drive with labels or exact truth, and output of its report."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from data.results.command_config import SECTION, CommandConfig
from data.results.evaluated import EvaluatedDrive, EvaluationDocument
from perception import __version__
from perception.cli.flags import DriveFlags, LabelledDriveFlags, ReportFlags
from perception.errors import DriveError, UsageError
from perception.evaluation.report import Measure, Report
from perception.pipeline import PipelineConfig
from perception.types import Drive

if TYPE_CHECKING:
    from data.recorded_drive import RecordedDrive


def open_labelled_drive(
    root: Path, flags: LabelledDriveFlags, *, images: bool = False
) -> "RecordedDrive":
    """Open a drive that has labels or exact truth to measure against.

    Args:
        root: Folder of the drive.
        flags: Sequence, sensor, and part of a split.
        images: Whether frames carry images.

    Raises:
        DriveError: The path holds no such drive.
        UsageError: The part holds no frame of the drive, or some frames of a sequence.
    """
    from data.open_drive import open_drive

    drive = open_drive(root, sequence=flags.sequence, config=flags.reading, images=images)
    if not (drive.has_labels or drive.has_point_truth):
        raise DriveError(
            drive.root,
            expected="labelled boxes or exact point truth to measure against",
            found="neither in this drive",
            advice="name the same drive in the tracking or object layout, or one that "
            "`trifuse synth` wrote",
        )
    (selected,) = flags.select([drive])
    if drive.is_sequence and len(selected) < len(drive):
        raise UsageError(
            f"--split {flags.split}",
            expected=f"all {len(drive)} frames of {drive.name} in one part, as they follow each other",
            found=f"{len(selected)} of them",
            advice="split with --by drives",
        )
    return selected


def evaluate_drive(
    drive: Drive, flags: DriveFlags, pipeline: PipelineConfig, measure: Measure[Any]
) -> EvaluatedDrive:
    """Run the pipeline over a drive and update a measure with every frame, with a progress bar.

    Raises:
        PerceptionError: A frame cannot be read or used.
    """
    from data.derived.motion_labels import evaluation_labels
    from perception.cli.drive_results import drive_results

    count = 0
    results = drive_results(drive, pipeline, limit=flags.frames, on_bad_frame=flags.on_bad_frame)
    for result in results:
        count += 1
        index = result.frame.index
        measure.update(result, evaluation_labels(drive, index), drive.point_truth(index))
    return EvaluatedDrive.of(drive, flags.frames, count)


def publish_report(
    heading: str,
    report: Report,
    document: EvaluationDocument,
    config: CommandConfig,
    output: ReportFlags,
) -> None:
    """Print the tables of a report below a heading; write its metrics into the files that are asked for.

    `--config` reads the configuration of the JSON file back.
    """
    tables = report.tables()
    print("\n\n".join([heading, *(table.text() for table in tables)]))
    if output.has_files:
        stated = {**vars(document), SECTION: config.values, "program": f"trifuse {__version__}"}
        printed = [table.printed() for table in tables]
        output.write({**stated, "tables": printed, "results": report.to_json()})
