"""`trifuse evaluate vehicles`."""

from pathlib import Path

from data.detections.config import LabelNoise, VehicleDetector
from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluatedDrive, EvaluationDocument
from perception.cli.evaluation import open_labelled_drive, publish_report
from perception.cli.flags import LabelledDriveFlags, ReportFlags
from perception.detection.config import DepthCnConfig, DetectionConfig
from perception.errors import CalibrationError, DriveError
from perception.pipeline import PipelineConfig

_PIPELINE = PipelineConfig(detection=DetectionConfig(depthcn=DepthCnConfig(enabled=False)))
_NOISE = LabelNoise()


def evaluate_vehicles(
    root: Path,
    *,
    drive: LabelledDriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    detector: VehicleDetector = "fused",
    display_score: float = DetectionConfig.display_score,
    noise: LabelNoise = _NOISE,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Measure detected vehicles as objects: HOTA, MOTA and IDF1 in the image, and positions on the road.

    Example: trifuse evaluate vehicles kitti/tracking --sequence 0000 --detector depthcn

    Args:
        root: Drive of any layout with a camera and labelled boxes that have track ids.
        detector: Detectors of the pipeline, DepthCN, or noisy labels, which show the error of location and tracking.
        display_score: Existence of a vehicle from which on it counts, 0 to 1.
        noise: Noise of the labels with `--detector labels`.
        pipeline: Pipeline configuration.
    """
    from data.detections.measured_vehicles import open_vehicle_detector
    from data.detections.unlearned_frames import count_learned_frames
    from perception.cli.drive_results import drive_results
    from perception.evaluation.vehicle_measure import PROTOCOL_WORDS, VehicleMeasure

    labelled = open_labelled_drive(root, drive, images=detector == "fused")
    if not (labelled.is_sequence and labelled.has_labels):
        raise DriveError(
            labelled.root,
            expected="frames in order of time with labelled boxes that have track ids",
            found="single frames" if labelled.has_labels else "no boxes",
            advice="name such a drive, or make one: trifuse synth OUT --layout tracking",
        )
    if labelled.calibration is None:
        raise CalibrationError(
            labelled.root,
            expected="a camera, in whose image vehicles are compared with labels",
            found="none",
        )
    opened = open_vehicle_detector(detector, labelled, pipeline.detection, noise)
    limit, skips = drive.frames, drive.on_bad_frame
    results = drive_results(labelled, opened.pipeline(pipeline), limit=limit, on_bad_frame=skips)
    measure = VehicleMeasure(display_score)
    for result in opened.results(results, pipeline.vehicles):
        measure.update(result, labelled.labels(result.frame.index), None)
    metrics = measure.compute()
    data = EvaluatedDrive.of(labelled, drive.frames, metrics.frames)
    document = EvaluationDocument.of_networks("vehicles", data, PROTOCOL_WORDS, opened.metadata)
    learned = count_learned_frames(opened.metadata, labelled.select(range(data.first_frames)))
    learned.warn(labelled.name)
    heading = f"{data}, detector {detector}, scores from {display_score:g}"
    if opened.metadata:
        heading = f"{heading}\n{learned}"
    publish_report(heading, metrics, document, config, report)
