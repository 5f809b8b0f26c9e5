"""`trifuse evaluate obstacles`."""

from pathlib import Path

from data.results.command_config import CommandConfig
from perception.cli.evaluation import (
    EvaluationDocument,
    evaluate_drive,
    open_labelled_drive,
    publish_report,
)
from perception.cli.flags import DriveFlags, ReportFlags
from perception.evaluation.config import ObstacleProtocol
from perception.pipeline import PipelineConfig

_PIPELINE, _PROTOCOL = PipelineConfig.for_obstacles(), ObstacleProtocol()


def evaluate_obstacles(
    root: Path,
    *,
    drive: DriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    pipeline: PipelineConfig = _PIPELINE,
    protocol: ObstacleProtocol = _PROTOCOL,
) -> None:
    """Count labelled objects that are found, missed and misclassified as static or moving, and false moving clusters.

    What moves follows from label boxes and INS poses. Where every point has exact truth, as in synthetic
    drives, the points classified as moving and static are counted too.

    Example: trifuse evaluate obstacles kitti/tracking --sequence 0000 --json obstacles.json

    Args:
        root: Tracking sequences, object frames, or a synthetic drive of any layout.
        pipeline: Pipeline configuration.
        protocol: Protocol of the evaluation.
    """
    from data.derived.motion_labels import label_drive_motion
    from data.kitti.sequence import KittiSequence
    from perception.evaluation.obstacle_measure import PROTOCOL_WORDS, ObstacleMeasure

    labelled = open_labelled_drive(root, drive)
    motion = None
    if isinstance(labelled, KittiSequence) and labelled.has_labels and labelled.has_poses:
        motion = label_drive_motion(labelled, protocol.motion)
    measure = ObstacleMeasure(pipeline.area, protocol.objects, motion)
    data = evaluate_drive(labelled, drive, pipeline, measure)
    words = {**PROTOCOL_WORDS, "values": protocol}
    document = EvaluationDocument("obstacles", data, words)
    publish_report(
        f"{data}, method {pipeline.method}", measure.compute(), document, config, report.json
    )
