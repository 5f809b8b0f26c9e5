"""A labelled drive through DepthCN once: what it says, and what is true."""

from dataclasses import dataclass

import numpy as np

from data.kitti.detection_rows import DetectionSet
from perception.cli.evaluations.labelled_drives import LabelledDrive, ReadingConfig, detect_drive
from perception.cli.vehicle_detector import VehicleDetector, VehicleDetectorOutput
from perception.detection.depthcn.verifier import VEHICLE
from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.types import Detections, Drive, Float64


@dataclass(frozen=True)
class DetectedCars:
    """What the detector says of a drive, and what is true.

    Attributes:
        data: which frames.
        boxes: labelled and detected.
        proposals: before verification.
        seconds: (F,) of all stages.
    """

    data: LabelledDrive
    boxes: DetectionSet
    proposals: DetectedBoxes
    seconds: Float64


def detect_cars(
    name: str, drive: Drive, detector: VehicleDetector, config: ReadingConfig
) -> DetectedCars:
    """Detect in the frames of a drive, and put their labels beside.

    Args:
        name: of the drive in the figures.
        drive: what is read.
        detector: what looks at it.
        config: which frames.

    Raises:
        PerceptionError: a frame or its labels cannot be read or used, or no frame can.
    """
    detected = detect_drive(
        name, drive, lambda frame: _KeptDetections.of(detector.detect(frame)), config
    )
    return DetectedCars(
        data=detected.data,
        boxes=detected.with_labels([one.detections for one in detected.outputs]),
        proposals=DetectedBoxes.of_frames([one.proposals for one in detected.outputs]),
        seconds=np.array([one.seconds for one in detected.outputs]),
    )


@dataclass(frozen=True)
class _KeptDetections:
    """What is kept of one frame: no scan, no image, no map."""

    detections: Detections
    proposals: Detections
    seconds: float

    @classmethod
    def of(cls, output: VehicleDetectorOutput) -> "_KeptDetections":
        boxes_px = output.proposals_px
        count = len(boxes_px)
        return cls(
            detections=output.detections,
            proposals=Detections(boxes_px, np.zeros(count), np.full(count, VEHICLE)),
            seconds=sum(output.timings_s.values()),
        )
