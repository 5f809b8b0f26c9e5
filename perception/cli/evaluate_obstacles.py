"""`trifuse evaluate obstacles`."""

from pathlib import Path
from typing import TYPE_CHECKING

from data.derived.obstacle_sequences import SequenceSet, table_3_1
from data.results.command_config import CommandConfig
from perception.cli.counting_sheet import CountingFlags, CountingJob
from perception.cli.evaluation import (
    EvaluatedDrive,
    EvaluationDocument,
    evaluate_drive,
    publish_report,
)
from perception.cli.flags import LabelledDriveFlags, ReportFlags
from perception.cli.sequence_sets import evaluate_drives
from perception.evaluation.config import ObstacleProtocol
from perception.pipeline import PipelineConfig
from perception.types import Drive

if TYPE_CHECKING:
    from perception.evaluation.obstacle_measure import ObstacleMeasure, ObstacleReport

_PIPELINE, _PROTOCOL = PipelineConfig.for_obstacles(), ObstacleProtocol()


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

    What moves follows from label boxes and INS poses. Where every point has exact truth, as in synthetic
    drives, every post, tree, wall and object is counted, and the points classified as moving and static too.

    Example: trifuse evaluate obstacles kitti/tracking --sequence 0000 --json obstacles.json

    Args:
        root: Tracking sequences, object frames, or a synthetic drive of any layout.
        set: Set of sequences: table-3.1, the 8 of the thesis, of which all that ROOT holds are evaluated; else one drive.
        pipeline: Pipeline configuration.
        protocol: Protocol of the evaluation.
    """
    from perception.evaluation.obstacle_measure import PROTOCOL_WORDS
    from perception.evaluation.obstacle_sets import ObstacleSetReport

    def measure_of(labelled: Drive) -> "ObstacleMeasure":
        return obstacle_measure(labelled, pipeline, protocol)

    words = {**PROTOCOL_WORDS, "values": protocol}
    if counting.counting_sheet is not None:
        job = CountingJob(
            counting.counting_sheet, counting.scans, counting.seed, drive, pipeline, measure_of
        )
        counted = job.report(root, set)
        document = EvaluationDocument("obstacles", {"root": root, "counting": counting}, words)
        publish_report(str(counted), counted, document, config, report.json)
        return

    def evaluate(labelled: Drive) -> "tuple[EvaluatedDrive, ObstacleReport]":
        measure = measure_of(labelled)
        data = evaluate_drive(labelled, drive, pipeline, measure)
        return data, measure.compute()

    data, metrics = evaluate_drives(
        root, set, drive, evaluate, lambda reports: ObstacleSetReport(reports, table_3_1())
    )
    document = EvaluationDocument("obstacles", data, words)
    publish_report(f"{data}, method {pipeline.method}", metrics, document, config, report.json)


def obstacle_measure(
    drive: Drive, pipeline: PipelineConfig, protocol: ObstacleProtocol
) -> "ObstacleMeasure":
    """Return the measure of the obstacles of a drive, which knows what moves where the drive has labels and poses."""
    from data.derived.motion_labels import label_drive_motion
    from data.kitti.sequence import KittiSequence
    from perception.evaluation.obstacle_measure import ObstacleMeasure

    motion = None
    if isinstance(drive, KittiSequence) and drive.has_labels and drive.has_poses:
        motion = label_drive_motion(drive, protocol.motion)
    return ObstacleMeasure(pipeline.area, protocol.objects, motion)
