"""Methods of finding and tracking moving objects, measured on the same segmented scans of a drive."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from data.derived.moving_truth import moving_truth
from data.frames import frame_count, read_frames
from data.labelled_drives import LabelledDrives
from data.recorded_drive import RecordedDrive
from data.results.evaluated import EvaluatedDrive
from data.synthetic.drive import SyntheticDrive
from data.synthetic.truth_files import read_truth, truth_files
from perception.datmo.stage import datmo_stage
from perception.evaluation.config import DatmoProtocol
from perception.evaluation.datmo_measure import DatmoComparison, DatmoMeasure, DatmoReport
from perception.evaluation.pose_intervals import PoseIntervals
from perception.geometry.threads import limit_blas_threads
from perception.pipeline import PipelineConfig
from perception.pipeline.lidar_stages import LidarStages
from perception.types import Drive, Float64

MotionMethod = Literal["default", "thesis", "author"]


def true_poses(drive: Drive) -> list[Float64] | None:
    """Return the exact (4, 4) world_SE3_velo of every frame of a synthetic drive; None of a recorded one."""
    if isinstance(drive, SyntheticDrive):
        return [drive.true_world_SE3_velo(index) for index in range(len(drive))]
    files = truth_files(drive) if isinstance(drive, RecordedDrive) else None
    if files is None or not isinstance(drive, RecordedDrive):
        return None
    return [posed.world_SE3_velo for posed in read_truth(drive, files)]


def compare_methods(
    drive: Drive,
    reader: LabelledDrives,
    pipeline: PipelineConfig,
    methods: Sequence[MotionMethod],
    protocol: DatmoProtocol,
) -> tuple[EvaluatedDrive, DatmoComparison]:
    """Measure the tracks of several methods; return frames and metrics.

    Args:
        drive: Labelled drive.
        reader: How its frames are read.
        pipeline: Configuration of the pipeline up to the segmented scan.
        methods: Methods, each once.
        protocol: Protocol of the evaluation.

    Raises:
        DriveError: The motion of the drive's objects is not known.
        PerceptionError: A frame cannot be read or used.
    """
    truth = moving_truth(drive, protocol.view, protocol.motion)
    measures = {method: DatmoMeasure(truth, protocol) for method in methods}
    configs = {method: replace(pipeline.datmo, method=method) for method in methods}
    area = pipeline.area_of(drive.sensor)
    stages = {m: datmo_stage(config, drive.sensor, area) for m, config in configs.items()}
    poses = PoseIntervals(true_poses(drive))
    lidar_stages = LidarStages(drive.sensor, pipeline)
    frames = read_frames(drive, on_bad_frame=reader.on_bad_frame, limit=reader.frames)
    for frame in reader.progress(frames, drive.name, frame_count(drive, reader.frames)):
        segmented, scan = lidar_stages.segment(frame)
        poses.update(segmented)
        for method, stage in stages.items():
            with limit_blas_threads():
                start_s = time.perf_counter()
                tracks = segmented.tracks if stage is None else stage.update(scan)
                timings_s = {"moving objects": time.perf_counter() - start_s}
            result = replace(segmented, tracks=tracks, timings_s=timings_s)
            measures[method].update(result, truth=drive.point_truth(frame.index))
    reports: dict[str, DatmoReport] = {method: one.compute() for method, one in measures.items()}
    count = next(iter(reports.values())).frames
    evaluated = EvaluatedDrive.of(drive, reader.frames, count)
    return evaluated, DatmoComparison(reports, poses.compute())
