"""`trifuse evaluate vehicles`."""

from pathlib import Path

from data.detections.config import LabelNoise, VehicleDetector
from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluatedDrive, EvaluationDocument
from perception.cli.flags import LabelledDriveFlags, ReportFlags
from perception.detection.config import DepthCnConfig, DetectionConfig
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
