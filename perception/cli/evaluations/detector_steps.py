"""A labelled drive through the detector of one modality, class by class beside what is true."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from perception.cli.evaluations.class_precision import ClassPrecision, MetricConfig
from perception.cli.evaluations.labelled_drives import DetectedDrive, ReadingConfig, detect_drive
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.errors import UsageError
from perception.evaluation.detection.protocol import DetectionClass, kitti_class
from perception.types import Detections, Drive, Float64, Frame, Modality

_THREADS = 2


@dataclass(frozen=True)
class FrameDetections:
    """What is kept of one frame.

    Attributes:
        index: of the frame in its drive.
        detections: of all classes.
        timings_s: for its picture, where it is made of the scan, and for the network.
    """

    index: int
    detections: Detections
    timings_s: Mapping[str, float]


@dataclass(frozen=True)
class MeasuredDetector:
    """What the detector is worth on one drive.

    Attributes:
        modality: that it looks at.
        detected: what it saw, and what is true.
        precision: by class.
    """

    modality: Modality
    detected: DetectedDrive[FrameDetections]
    precision: Mapping[DetectionClass, ClassPrecision]

    @property
    def ms_per_frame(self) -> Float64:
        """(F,) for picture and network."""
        return 1e3 * np.array([sum(detect.timings_s.values()) for detect in self.detected.outputs])

    def median_ms(self, part: str) -> float:
        """Return the median time of a part, `maps` or the modality, in milliseconds."""
        return 1e3 * float(np.median([detect.timings_s[part] for detect in self.detected.outputs]))


def open_detector(model: Modality | Path) -> ModalityDetector:
    """Open the network of a file, or the one that ships for a modality.

    Raises:
        ModelError: the file holds no detector.
    """
    return ModalityDetector(model, _THREADS)


def parse_classes(
    network: ModalityDetector, names: str | tuple[str, ...] | None
) -> tuple[DetectionClass, ...]:
    """Return what is measured: the classes named, or all that the network knows.

    Raises:
        UsageError: it does not know one of them.
    """
    named = (names,) if isinstance(names, str) else names or network.class_names
    known = {name.lower(): name for name in network.class_names}
    for name in named:
        if name.lower() not in known:
            raise UsageError("--classes", expected=", ".join(network.class_names), found=name)
    return tuple(kitti_class(known[name.lower()]) for name in named)


def measure_detector(
    name: str,
    drive: Drive,
    network: ModalityDetector,
    classes: tuple[DetectionClass, ...],
    reading: ReadingConfig,
    measuring: MetricConfig,
) -> MeasuredDetector:
    """Detect in the frames of a drive and measure every class.

    Raises:
        PerceptionError: a frame or its labels cannot be read or used, or no frame can.
    """
    detector = MultimodalDetector({network.modality: network}, workers=1)

    def detect(frame: Frame) -> FrameDetections:
        output = detector.detect(frame)
        return FrameDetections(
            frame.index, output.modality_detections[network.modality], output.timings_s
        )

    detected = detect_drive(name, drive, detect, reading)
    found = detected.with_labels([one.detections for one in detected.outputs])
    return MeasuredDetector(
        network.modality,
        detected,
        {one: ClassPrecision.of(found, one, measuring) for one in classes},
    )
