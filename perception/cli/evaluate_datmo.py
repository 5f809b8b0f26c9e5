"""`trifuse evaluate datmo`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from data.derived.obstacle_sequences import SequenceSet, table_3_1
from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluatedDrive, EvaluationDocument
from perception.cli.evaluation import publish_report
from perception.cli.flags import DriveFlags, LabelledDriveFlags, ReportFlags
from perception.cli.sequence_sets import evaluate_drives
from perception.errors import UsageError
from perception.evaluation.config import DatmoProtocol
from perception.pipeline import PipelineConfig
from perception.types import Drive

if TYPE_CHECKING:
    from perception.evaluation.datmo_measure import DatmoComparison

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
        set: Set of sequences: table-3.1, the 8 of the thesis, of which all that ROOT holds are evaluated; else one drive.
        methods: Methods that are compared; all of them get the segmented scans of one pipeline.
        pipeline: Configuration of the pipeline up to the segmented scan.
        protocol: Protocol of the evaluation; `view: all` takes labels of everything around:
            synthetic drives, Argoverse 2, nuScenes.
    """
    from perception.evaluation.datmo_measure import PROTOCOL_WORDS, DatmoSetReport

    if not methods or len({*methods}) < len(methods):
        known = ", ".join(get_args(Method))
        raise UsageError(
            "--methods", expected=f"some of {known}, each once", found=repr(",".join(methods))
        )

    def evaluate(labelled: Drive) -> "tuple[EvaluatedDrive, DatmoComparison]":
        comparison = compare_methods(labelled, drive, pipeline, methods, protocol)
        frames = next(iter(comparison.reports.values())).frames
        return EvaluatedDrive.of(labelled, drive.frames, frames), comparison

    data, metrics = evaluate_drives(
        root, set, drive, evaluate, lambda reports: DatmoSetReport(reports, table_3_1())
    )
    document = EvaluationDocument("datmo", data, {**PROTOCOL_WORDS, "values": protocol})
    heading = f"{data}, method {pipeline.method}, evaluated view: {protocol.view}"
    publish_report(heading, metrics, document, config, report)


def compare_methods(
    drive: Drive,
    flags: DriveFlags,
    pipeline: PipelineConfig,
    methods: Sequence[Method],
    protocol: DatmoProtocol,
) -> "DatmoComparison":
    """Measure the tracks of several methods that get the same segmented scans, with a progress bar.

    Raises:
        DriveError: The motion of the drive's objects is not known.
        PerceptionError: A frame cannot be read or used.
    """
    import time

    from data.derived.moving_truth import moving_truth
    from data.derived.true_poses import true_poses
    from data.frames import frame_count, read_frames
    from perception.cli.progress import progress_bar
    from perception.datmo.stage import datmo_stage
    from perception.evaluation.datmo_measure import DatmoComparison, DatmoMeasure
    from perception.evaluation.pose_intervals import PoseIntervals
    from perception.geometry.threads import limit_blas_threads
    from perception.pipeline.lidar_stages import LidarStages

    truth = moving_truth(drive, protocol.view, protocol.motion)
    measures = {method: DatmoMeasure(truth, protocol) for method in methods}
    configs = {method: replace(pipeline.datmo, method=method) for method in methods}
    stages = {m: datmo_stage(config, drive.sensor, pipeline.area) for m, config in configs.items()}
    poses = PoseIntervals(true_poses(drive))
    lidar_stages = LidarStages(drive.sensor, pipeline)
    frames = read_frames(drive, on_bad_frame=flags.on_bad_frame, limit=flags.frames)
    for frame in progress_bar(frames, drive.name, frame_count(drive, flags.frames)):
        segmented, scan = lidar_stages.segment(frame)
        poses.update(segmented)
        for method, stage in stages.items():
            with limit_blas_threads():
                start_s = time.perf_counter()
                tracks = segmented.tracks if stage is None else stage.update(scan)
                timings_s = {"moving objects": time.perf_counter() - start_s}
            result = replace(segmented, tracks=tracks, timings_s=timings_s)
            measures[method].update(result, truth=drive.point_truth(frame.index))
    return DatmoComparison(
        {method: one.compute() for method, one in measures.items()}, poses.compute()
    )
