"""`trifuse evaluate obstacles`."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from data.derived.obstacle_sequences import SequenceSet, find_sequences, table_3_1
from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluatedDrive, EvaluationDocument
from perception.cli.evaluation import evaluate_drive, publish_report
from perception.cli.flags import LabelledDriveFlags, ReportFlags, require_positive
from perception.cli.parser import FlagGroup
from perception.cli.sequence_sets import evaluate_drives
from perception.evaluation.config import ObstacleProtocol
from perception.pipeline import PipelineConfig
from perception.types import Drive, Result

if TYPE_CHECKING:
    from perception.evaluation.obstacle_measure import ObstacleReport
    from perception.evaluation.obstacle_sets import CountingReport

_PIPELINE, _PROTOCOL = PipelineConfig.for_obstacles(), ObstacleProtocol()


@dataclass(frozen=True)
class CountingFlags(FlagGroup):
    """Counting by a person.

    Attributes:
        counting_sheet: Folder of a counting sheet: the first call writes overlay images of random scans and a sheet
            with empty counts, which exact truth fills in; every call prints the sheet in the form of Table 7.2.
        scans: Number of random scans of each sequence.
        seed: Seed of the choice of scans.
    """

    counting_sheet: Path | None = None
    scans: int = 25
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate the number of scans."""
        require_positive("--scans", self.scans)


def evaluate_obstacles(
    root: Path,
    *,
    drive: LabelledDriveFlags,
    counting: CountingFlags,
    report: ReportFlags,
    config: CommandConfig,
    set: SequenceSet | None = None,
    pipeline: PipelineConfig = _PIPELINE,
    protocol: ObstacleProtocol = _PROTOCOL,
) -> None:
    """Count labelled objects that are found, missed and misclassified as static or moving, and false moving clusters.

    What moves follows from label boxes and INS poses. Where every point has a class, as in synthetic drives,
    SemanticKITTI, nuScenes-lidarseg and Argoverse 2, every post, tree, wall and object is counted, and the points
    classified as moving and static too: precision, recall, F1 and IoU. Points without a label are left out.

    Example: trifuse evaluate obstacles kitti/tracking --sequence 0000 --json obstacles.json

    Args:
        root: Drive of any layout with labelled boxes or classes of points.
        set: Set of sequences: table-3.1, the 8 of the thesis, of which all that ROOT holds are evaluated; else one drive.
        pipeline: Pipeline configuration.
        protocol: Protocol of the evaluation.
    """
    from data.derived.motion_labels import obstacle_measure
    from perception.evaluation.obstacle_measure import PROTOCOL_WORDS
    from perception.evaluation.obstacle_sets import ObstacleSetReport

    words = {**PROTOCOL_WORDS, "values": protocol}
    if counting.counting_sheet is not None:
        counted = _count(root, set, counting, drive, pipeline, protocol)
        document = EvaluationDocument("obstacles", {"root": root, "counting": counting}, words)
        publish_report(str(counted), counted, document, config, report)
        return

    def evaluate(labelled: Drive) -> "tuple[EvaluatedDrive, ObstacleReport]":
        measure = obstacle_measure(labelled, pipeline.area, protocol)
        data = evaluate_drive(labelled, drive, pipeline, measure)
        return data, measure.compute()

    data, metrics = evaluate_drives(
        root, set, drive, evaluate, lambda reports: ObstacleSetReport(reports, table_3_1())
    )
    document = EvaluationDocument("obstacles", data, words)
    publish_report(f"{data}, method {pipeline.method}", metrics, document, config, report)


def _count(
    root: Path,
    set: SequenceSet | None,
    counting: CountingFlags,
    flags: LabelledDriveFlags,
    pipeline: PipelineConfig,
    protocol: ObstacleProtocol,
) -> "CountingReport":
    """Write the images and the sheet where there is no sheet yet, and return what the sheet holds."""
    from data.derived.motion_labels import obstacle_measure
    from data.open_drive import open_drive
    from data.results.counted_scans import CountedScans
    from perception.cli.drive_results import drive_results

    def results_of(drive: Drive, count: int) -> Iterable[Result]:
        return drive_results(drive, pipeline, limit=count, on_bad_frame=flags.on_bad_frame)

    assert counting.counting_sheet is not None
    scans = CountedScans(counting.counting_sheet, counting.scans, counting.seed, flags.frames)
    if not scans.sheet.exists():
        names = [flags.sequence]
        if set is not None:
            names = [one.sequence for one in find_sequences(root, set, flags.sequence)[0]]
        drives = [
            open_drive(root, sequence=one, config=flags.reading, images=True) for one in names
        ]
        scans.write(
            flags.select(drives),
            results_of,
            lambda drive: obstacle_measure(drive, pipeline.area, protocol),
        )
    return scans.report()
