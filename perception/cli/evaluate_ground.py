"""`trifuse evaluate ground`."""

from pathlib import Path

from data.results.command_config import CommandConfig
from perception.cli.evaluation import (
    EvaluationDocument,
    evaluate_drive,
    open_labelled_drive,
    publish_report,
)
from perception.cli.flags import DriveFlags, ReportFlags
from perception.pipeline import PipelineConfig

_PIPELINE = PipelineConfig.for_obstacles()


def evaluate_ground(
    root: Path,
    *,
    drive: DriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Measure how far the estimated ground is from the bottom centres of labelled objects, in metres.

    Where every point has an exact class, as in synthetic drives, the points classified as ground are counted too.

    Example: trifuse evaluate ground kitti/tracking --sequence 0000 --json ground.json

    Args:
        root: Tracking sequences, object frames, or a synthetic drive of any layout.
        pipeline: Pipeline configuration.
    """
    from perception.evaluation.ground import PROTOCOL, GroundMeasure, thesis_slice_edges_m

    labelled = open_labelled_drive(root, drive)
    area = pipeline.area
    measure = GroundMeasure(area, thesis_slice_edges_m(labelled.sensor, area))
    data = evaluate_drive(labelled, drive, pipeline, measure)
    document = EvaluationDocument("ground", data, PROTOCOL)
    publish_report(
        f"{data}, method {pipeline.method}", measure.compute(), document, config, report.json
    )
