"""`trifuse evaluate poses`."""

from pathlib import Path

from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluationDocument
from perception.cli.flags import DriveFlags, ReportFlags
from perception.pipeline import PipelineConfig

_PIPELINE = PipelineConfig.for_obstacles()


def evaluate_poses(
    root: Path,
    *,
    drive: DriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Measure poses beside those of the drive, with its INS as prior and by scans alone: steps, heading, end and drift.

    Example: trifuse evaluate poses kitti/tracking --sequence 0000 --html poses.html

    Args:
        root: Drive of any layout with poses.
        pipeline: Pipeline configuration.
    """
    from data.measured_poses import measure_poses
    from perception.evaluation.pose_errors import PROTOCOL

    data, reference, errors = measure_poses(root, drive.reader(), pipeline)
    document = EvaluationDocument("poses", data, PROTOCOL)
    report.publish(f"{data}, beside the {reference}", errors, document, config)
