"""A labelled drive through DepthCN once: what it says, and what is true."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.drive import Drive, Labels
from data.frames import OnBadFrame, file_number
from data.kitti.detection_rows import DetectionSet
from data.open_drive import open_drive
from data.true_boxes import true_boxes
from perception.cli.vehicle_detector import Sighting, VehicleDetector, sightings
from perception.detection.verifier import VEHICLE
from perception.errors import DriveError
from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.types import Detections, Float64


@dataclass(frozen=True)
class LabelledDrive:
    """Which frames the figures are of.

    Attributes:
        name: as asked for.
        root: folder.
        sensor: name of the LiDAR model.
        is_synthetic: whether the truth of every point is known, which it is of no recorded drive.
        frames: how many the drive has.
        frames_evaluated: how many of those asked for could be read.
    """

    name: str
    root: Path
    sensor: str
    is_synthetic: bool
    frames: int
    frames_evaluated: int


@dataclass(frozen=True)
class FoundCars:
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


def open_labelled(path: Path, sequence: str | None, sensor: str | None) -> Drive:
    """Open a drive that has labelled boxes.

    Raises:
        DriveError: it has none.
    """
    drive = open_drive(path, sequence=sequence, sensor=sensor)
    if not drive.has_labels:
        raise DriveError(
            drive.root,
            expected="labelled boxes to measure against",
            found="none in this drive",
            advice="name the same drive in the tracking or object layout",
        )
    return drive


def find_cars(
    name: str,
    drive: Drive,
    detector: VehicleDetector,
    limit: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
) -> FoundCars:
    """Detect in the frames of a drive, and put their labels beside.

    Args:
        name: of the drive in the figures.
        drive: what is read.
        detector: what looks at it.
        limit: only so many frames from the start, or None.
        on_bad_frame: stop or skip.

    Raises:
        PerceptionError: a frame or its labels cannot be read or used, or no frame can.
    """
    seen: list[_LabelledSighting] = []
    for sighting in sightings(drive, detector, limit=limit, on_bad_frame=on_bad_frame):
        seen.append(_LabelledSighting.of(sighting, drive))
    if not seen:
        raise DriveError(drive.root, expected="a frame that can be read", found="none")
    data = LabelledDrive(
        name=name,
        root=drive.root.resolve(),
        sensor=drive.sensor.name,
        is_synthetic=drive.point_truth(seen[0].index) is not None,
        frames=len(drive),
        frames_evaluated=len(seen),
    )
    boxes = DetectionSet(
        numbers=tuple(one.number for one in seen),
        truths=true_boxes([one.labels for one in seen]),
        detections=DetectedBoxes.of_frames([one.detections for one in seen]),
        without_result=(),
        beyond=(),
    )
    proposals = DetectedBoxes.of_frames([one.proposals for one in seen])
    return FoundCars(data, boxes, proposals, np.array([one.seconds for one in seen]))


@dataclass(frozen=True)
class _LabelledSighting:
    """What is kept of one frame: no scan, no image, no map."""

    index: int
    number: int
    labels: Labels
    detections: Detections
    proposals: Detections
    seconds: float

    @classmethod
    def of(cls, sighting: Sighting, drive: Drive) -> "_LabelledSighting":
        index, boxes_px = sighting.frame.index, sighting.proposals_px
        count = len(boxes_px)
        return cls(
            index=index,
            number=file_number(drive, index),
            labels=drive.labels(index),
            detections=sighting.detections,
            proposals=Detections(boxes_px, np.zeros(count), np.full(count, VEHICLE)),
            seconds=sum(sighting.timings_s.values()),
        )
