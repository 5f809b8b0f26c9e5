"""`trifuse evaluate obstacles`."""

from dataclasses import dataclass
from pathlib import Path

from data.derived.obstacle_sequences import SequenceSet, table_3_1
from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluationDocument
from perception.cli.flags import LabelledDriveFlags, ReportFlags, require_positive
from perception.cli.parser import FlagGroup
from perception.evaluation.config import ObstacleProtocol
from perception.pipeline import PipelineConfig

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

    What moves follows from label boxes and INS poses. Where every point has a class, every post, tree, wall and object
    is counted. IoU of moving points is that of SemanticKITTI-MOS; points without a label are left out.

    Example: trifuse evaluate obstacles kitti/tracking --sequence 0000 --json obstacles.json

    Args:
        root: Drive of any layout with labelled boxes or classes of points.
        set: Set of sequences: table-3.1, the 8 of the thesis, as far as ROOT holds them; one drive by default.
        pipeline: Pipeline configuration.
        protocol: Protocol of the evaluation.
    """
    from data.derived.motion_labels import obstacle_measure
    from perception.evaluation.obstacle_measure import PROTOCOL_WORDS
    from perception.evaluation.obstacle_sets import ObstacleSetReport

    reader, words = drive.reader(), {**PROTOCOL_WORDS, "values": protocol}
    if counting.counting_sheet is not None:
        from data.results.counted_scans import CountedScans

        scans = CountedScans(
            counting.counting_sheet, counting.scans, counting.seed, pipeline, protocol
        )
        counted = scans.evaluate(root, set, reader)
        document = EvaluationDocument("obstacles", {"root": root, "counting": counting}, words)
        report.publish(str(counted), counted, document, config)
        return
    data, metrics = reader.evaluate_set(
        root,
        set,
        lambda labelled: reader.evaluate(
            labelled, pipeline, obstacle_measure(labelled, pipeline.area, protocol)
        ),
        lambda reports: ObstacleSetReport(reports, table_3_1()),
    )
    document = EvaluationDocument("obstacles", data, words)
    report.publish(f"{data}, method {pipeline.method}", metrics, document, config)
