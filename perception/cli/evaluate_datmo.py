"""`trifuse evaluate datmo`."""

from pathlib import Path
from typing import Literal, get_args

from data.derived.obstacle_sequences import SequenceSet, table_3_1
from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluationDocument
from perception.cli.flags import LabelledDriveFlags, ReportFlags
from perception.errors import UsageError
from perception.evaluation.config import DatmoProtocol
from perception.pipeline import PipelineConfig

Method = Literal["default", "thesis", "author"]

_PIPELINE, _PROTOCOL = PipelineConfig.for_motion("none"), DatmoProtocol()


def evaluate_datmo(
    root: Path,
    *,
    drive: LabelledDriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    set: SequenceSet | None = None,
    methods: tuple[Method, ...] = ("default", "thesis", "author"),
    pipeline: PipelineConfig = _PIPELINE,
    protocol: DatmoProtocol = _PROTOCOL,
) -> None:
    """Measure how well moving objects are tracked on the ground plane, several methods on the same scans.

    HOTA, CLEAR and IDF1 by distance and by overlap, errors of position, velocity and extent, ids by length, each object.

    Example: trifuse evaluate datmo kitti/tracking --sequence 0000 --methods default,thesis

    Args:
        root: Drive with poses and labelled boxes that have tracks.
        set: Set of sequences: table-3.1, the 8 of the thesis, as far as ROOT holds them; one drive by default.
        methods: Methods that are compared; all of them get the segmented scans of one pipeline.
        pipeline: Configuration of the pipeline up to the segmented scan.
        protocol: Protocol of the evaluation; `view: all` takes labels of everything around:
            synthetic drives, Argoverse 2, nuScenes.
    """
    from data.derived.moving_methods import compare_methods
    from perception.evaluation.datmo_measure import PROTOCOL_WORDS, DatmoSetReport

    if not methods or len({*methods}) < len(methods):
        known = ", ".join(get_args(Method))
        raise UsageError(
            "--methods", expected=f"some of {known}, each once", found=repr(",".join(methods))
        )
    reader = drive.reader()
    data, metrics = reader.evaluate_set(
        root,
        set,
        lambda labelled: compare_methods(labelled, reader, pipeline, methods, protocol),
        lambda reports: DatmoSetReport(reports, table_3_1()),
    )
    document = EvaluationDocument("datmo", data, {**PROTOCOL_WORDS, "values": protocol})
    heading = f"{data}, method {pipeline.method}, evaluated view: {protocol.view}"
    report.publish(heading, metrics, document, config)
