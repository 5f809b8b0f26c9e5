"""`trifuse evaluate` of the stages: ground, obstacles, poses, moving objects, one object, vehicles."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from data.derived.obstacle_sequences import PRINTED_MDE_M, SequenceSet, table_3_1
from data.detections.config import LabelNoise, VehicleDetector
from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluatedDrive, EvaluationDocument
from perception.cli.flags import DriveFlags, LabelledDriveFlags, ReportFlags, require_positive
from perception.cli.parser import FlagGroup
from perception.detection.config import DepthCnConfig, DetectionConfig
from perception.errors import UsageError
from perception.evaluation.config import DatmoProtocol, ObstacleProtocol
from perception.pipeline import PipelineConfig
from perception.tracking.single_object.config import SingleObjectTrackerConfig
from perception.types import Drive

Method = Literal["default", "thesis", "author"]
ObjectSet = Literal["table-3.2", "3d-otd", "all", "present"]
_OBSTACLES, _MOTION = PipelineConfig.for_obstacles(), PipelineConfig.for_motion("none")
_VEHICLES = PipelineConfig(detection=DetectionConfig(depthcn=DepthCnConfig(enabled=False)))
_OBSTACLE_PROTOCOL, _DATMO_PROTOCOL = ObstacleProtocol(), DatmoProtocol()
_TRACKER, _NOISE = SingleObjectTrackerConfig(), LabelNoise()


def evaluate_ground(
    root: Path,
    *,
    drive: LabelledDriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    set: SequenceSet | None = None,
    pipeline: PipelineConfig = _OBSTACLES,
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
    from perception.evaluation import ground

    reader = drive.reader()

    def evaluate(labelled: Drive) -> tuple[EvaluatedDrive, ground.GroundReport]:
        area = pipeline.area_of(labelled.sensor)
        return reader.evaluate(labelled, pipeline, ground.GroundMeasure(labelled.sensor, area))

    data, metrics = reader.evaluate_set(
        root, set, evaluate, lambda reports: ground.GroundSetReport(reports, PRINTED_MDE_M)
    )
    document = EvaluationDocument("ground", data, ground.PROTOCOL)
    report.publish(f"{data}, method {pipeline.method}", metrics, document, config)


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
    pipeline: PipelineConfig = _OBSTACLES,
    protocol: ObstacleProtocol = _OBSTACLE_PROTOCOL,
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
    if (sheet := counting.counting_sheet) is not None:
        from data.results.counted_scans import CountedScans

        scans = CountedScans(sheet, counting.scans, counting.seed, pipeline, protocol)
        counted = scans.evaluate(root, set, reader)
        document = EvaluationDocument("obstacles", {"root": root, "counting": counting}, words)
        report.publish(str(counted), counted, document, config)
        return
    data, metrics = reader.evaluate_set(
        root,
        set,
        lambda labelled: reader.evaluate(
            labelled,
            pipeline,
            obstacle_measure(labelled, pipeline.area_of(labelled.sensor), protocol),
        ),
        lambda reports: ObstacleSetReport(reports, table_3_1()),
    )
    document = EvaluationDocument("obstacles", data, words)
    report.publish(f"{data}, method {pipeline.method}", metrics, document, config)


def evaluate_poses(
    root: Path,
    *,
    drive: DriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    pipeline: PipelineConfig = _OBSTACLES,
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


def evaluate_datmo(
    root: Path,
    *,
    drive: LabelledDriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    set: SequenceSet | None = None,
    methods: tuple[Method, ...] = ("default", "thesis", "author"),
    pipeline: PipelineConfig = _MOTION,
    protocol: DatmoProtocol = _DATMO_PROTOCOL,
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


def evaluate_otd(
    root: Path,
    *,
    drive: DriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    set: ObjectSet = "all",
    trackers: tuple[str, ...] = (),
    track_id: int | None = None,
    plots: Path | None = None,
    tracker: SingleObjectTrackerConfig = _TRACKER,
    pipeline: PipelineConfig = _MOTION,
) -> None:
    """Measure trackers of one object on the sequences of the thesis, or on any labelled track.

    E3D, E2D and E_phi of Tables 7.6 and 7.7, overlap and heading success of Appendix A, Success and Precision
    of one-pass evaluation, shares of frames seen and lost, and time. Absent sequences are listed.

    Example: trifuse evaluate otd kitti/tracking --set present --sequence 0000 --trackers default,h-fus

    Args:
        root: KITTI's tracking data, or a synthetic drive.
        set: Set of objects: table-3.2 (8 sequences), 3d-otd (Table A.1, 50), both, or every labelled track of 15 frames.
        trackers: Names of the trackers, such as default,h-fus,3d-kf; all of them by default, which takes long.
        track_id: Track id of the only object; all by default.
        plots: Folder for the plots of Figs A.1 to A.3 and of one-pass evaluation.
        tracker: Configuration of the trackers (Table 7.5).
        pipeline: Configuration of the pipeline up to the ground.
    """
    from data.derived.otd_objects import ObjectSetConfig, find_objects, measure_trackers
    from perception.cli.progress import progress_bar
    from perception.evaluation.single_object import tracker_runs
    from perception.evaluation.single_object.measure import PROTOCOL
    from perception.evaluation.single_object.plots import write_plots

    names = tracker_runs.require_trackers(trackers)
    set_config = ObjectSetConfig(root, set, drive.sequence, track_id, drive.frames, drive.reading)
    found = find_objects(set_config)
    metrics = measure_trackers(found, names, tracker, pipeline, drive.on_bad_frame, progress_bar)
    document = EvaluationDocument("otd", {"config": set_config, **found.to_json()}, PROTOCOL)
    heading = found.heading(root, set, len(metrics.objects))
    if "h-fus" in names:
        heading = f"{heading}\n\n{tracker_runs.fusion_parameters(tracker).text()}"
    report.publish(heading, metrics, document, config)
    if plots is not None:
        for path in write_plots(plots, f"{root.name}, set {set}", metrics):
            print(path)


def evaluate_vehicles(
    root: Path,
    *,
    drive: LabelledDriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    detector: VehicleDetector = "fused",
    display_score: float = DetectionConfig.display_score,
    noise: LabelNoise = _NOISE,
    pipeline: PipelineConfig = _VEHICLES,
) -> None:
    """Measure detected vehicles as objects: HOTA, MOTA and IDF1, AMOTA where all round is labelled, and positions on the road.

    Example: trifuse evaluate vehicles kitti/tracking --sequence 0000 --detector depthcn

    Args:
        root: Drive of any layout with a camera and labelled boxes that have track ids.
        detector: Detectors of the pipeline, DepthCN, or noisy labels, which show the error of location and tracking.
        display_score: Minimum existence probability of a vehicle that counts, 0 to 1.
        noise: Noise of the labels with `--detector labels`.
        pipeline: Pipeline configuration.
    """
    from data.detections.measured_vehicles import measure_vehicles, open_vehicle_detector
    from data.detections.unlearned_frames import count_learned_frames
    from perception.evaluation.vehicle_measure import PROTOCOL_WORDS

    reader = drive.reader()
    labelled = reader.open(root, images=detector == "fused")
    opened = open_vehicle_detector(detector, labelled, pipeline.detection, noise)
    metrics = measure_vehicles(labelled, reader, opened, pipeline, display_score)
    data = EvaluatedDrive.of(labelled, drive.frames, metrics.frames)
    document = EvaluationDocument.of_networks("vehicles", data, PROTOCOL_WORDS, opened.metadata)
    learned = count_learned_frames(opened.metadata, labelled.select(range(data.first_frames)))
    learned.warn(labelled.name)
    note = f"\n{learned}" if opened.metadata else ""
    heading = f"{data}, detector {detector}, scores from {display_score:g}{note}"
    report.publish(heading, metrics, document, config)
