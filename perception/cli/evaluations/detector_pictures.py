"""The frames in which a detector makes most mistakes, drawn as it saw them."""

import re
from pathlib import Path

import numpy as np

from data.atomic_file import write_jpeg
from perception.cli.evaluations.detector_steps import MeasuredDetector
from perception.detection.detectors.modalities import modality_image
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.evaluation.detection.evaluation_boxes import evaluation_mask, pair_boxes
from perception.evaluation.detection.frame_errors import count_frame_errors
from perception.evaluation.detection.protocol import DIFFICULTIES, DetectionClass
from perception.render.detection_errors import draw_detection_errors
from perception.types import Drive, UInt8

_DIFFICULTY = DIFFICULTIES[-1]  # where most objects count


def draw_worst_frames(
    folder: Path, drive: Drive, network: ModalityDetector, measured: MeasuredDetector, most: int
) -> None:
    """Write pictures DRIVE_CLASS_RANK_NUMBER.jpg of the worst frames of every class."""
    detected = measured.detected
    drive_name = "_".join(re.findall(r"\w+", detected.data.name))
    for of_class, precision in measured.precision.items():
        target_class = of_class.at_iou(next(iter(precision.reports)))
        found = detected.with_labels([output.detections for output in detected.outputs])
        frame_errors = count_frame_errors(
            found.truths, found.detections, len(detected.outputs), target_class, _DIFFICULTY
        )
        for rank, place in enumerate(frame_errors.worst(most).tolist()):
            frame = drive[detected.outputs[place].index]
            image = _draw_errors(
                modality_image(frame, network.modality, network.filling),
                measured,
                place,
                target_class,
                frame_errors.threshold,
            )
            name = f"{drive_name}_{target_class.name}_{rank:02d}_{detected.numbers[place]:06d}.jpg"
            write_jpeg(folder / name, image, quality=95)


def _draw_errors(
    image: UInt8,
    measured: MeasuredDetector,
    place: int,
    of_class: DetectionClass,
    threshold: float,
) -> UInt8:
    """Draw one frame; what may be found but need not be is told as the measure tells it."""
    detected = measured.detected
    truths = detected.truths[detected.truths.frames == place]
    evaluation_boxes = pair_boxes(truths, DetectedBoxes.of_frames(()), len(detected.outputs))
    is_valid_truth = evaluation_mask(evaluation_boxes, of_class, _DIFFICULTY).is_valid_truth
    detections = detected.outputs[place].detections
    counts = (detections.scores >= threshold) & (
        np.char.lower(detections.types) == of_class.name.lower()
    )
    return draw_detection_errors(
        image,
        truths.boxes_px[is_valid_truth],
        truths.boxes_px[~is_valid_truth],
        detections[counts],
        of_class.iou,
    )
