"""Detectors and their fusion on a labelled drive under sensor corruptions."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from data.corruptions import sensor_corruptions
from data.detections.measured_detectors import open_fusions, open_modalities
from data.detections.measured_drives import DriveReader, DrivesReport
from perception.detection.config import DetectionConfig
from perception.evaluation.detection.config import CorruptionLevels, PrecisionConfig
from perception.evaluation.detection.protocol import DetectionClass
from perception.evaluation.detection.robustness_measure import (
    RobustnessMeasure,
    corrupted_detector,
)


def measure_corruptions(
    root: Path,
    reader: DriveReader,
    classes: Sequence[DetectionClass],
    metric: PrecisionConfig,
    levels: CorruptionLevels,
    detection: DetectionConfig,
) -> tuple[DrivesReport, Mapping[str, Mapping[str, str]]]:
    """Measure average precision over the levels of each corruption; return the metadata of each network, too.

    Args:
        root: Object folder, tracking folder or synthetic drive.
        reader: How it is opened and read.
        classes: Classes to measure.
        metric: Average precision.
        levels: Levels of each corruption.
        detection: Detectors: networks and suppression.

    Raises:
        PerceptionError: A frame or its labels cannot be read or used.
    """
    name, frames = reader.drives([root])[0]
    # Single frames have a calibration each.
    has_camera = frames.calibration is not None or not frames.is_sequence
    corruptions = sensor_corruptions(levels, has_camera=has_camera, has_images=frames.has_images)
    detector = open_modalities(detection)
    fusion = open_fusions(detection, (), detector)["default"]
    measure = RobustnessMeasure(classes, metric, corruptions=corruptions, fusion=fusion)
    detect = corrupted_detector(detector, corruptions, metric.seed)
    networks = {str(name): dict(one.metadata) for name, one in detector.detectors.items()}
    networks["fusion default"] = dict(fusion.metadata)
    info, _ = reader.feed(name, frames, detect, measure, networks)
    return DrivesReport([(info, measure.compute())]), networks
