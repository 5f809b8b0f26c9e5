"""`trifuse evaluate ground`."""

from pathlib import Path

from data.derived.obstacle_sequences import PRINTED_MDE_M, SequenceSet
from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluationDocument
from perception.cli.flags import LabelledDriveFlags, ReportFlags
from perception.pipeline import PipelineConfig

_PIPELINE = PipelineConfig.for_obstacles()


def evaluate_ground(
    root: Path,
    *,
    drive: LabelledDriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    set: SequenceSet | None = None,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Measure how far the estimated ground is from the bottom centres of labelled objects, in metres.

    Where every point has a class, as in synthetic drives, SemanticKITTI, nuScenes-lidarseg and Argoverse 2, the points
    classified as ground are counted too: precision, recall, F1 and IoU, by range. Points without a label are left out.

    Example: trifuse evaluate ground kitti/tracking --sequence 0000 --json ground.json

    Args:
        root: Drive of any layout with labelled boxes or classes of points.
        set: Set of sequences: table-3.1, the 8 of the thesis, as far as ROOT holds them; one drive by default.
        pipeline: Pipeline configuration.
    """
    from perception.evaluation.ground import (
        PROTOCOL,
        GroundMeasure,
        GroundSetReport,
        thesis_slice_edges_m,
    )

    reader, area = drive.reader(), pipeline.area
    data, metrics = reader.evaluate_set(
        root,
        set,
        lambda labelled: reader.evaluate(
            labelled, pipeline, GroundMeasure(area, thesis_slice_edges_m(labelled.sensor, area))
        ),
        lambda reports: GroundSetReport(reports, PRINTED_MDE_M),
    )
    document = EvaluationDocument("ground", data, PROTOCOL)
    report.publish(f"{data}, method {pipeline.method}", metrics, document, config)
