"""Fusion of detected frames step by step (Fig. 7.14), and the precision of each step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from data.detections.detected_frames import DetectedFrames
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.rescoring import Fusion
from perception.evaluation.detection.average_precision import (
    PrecisionCurve,
    kitti_average_precision,
)
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.protocol import KITTI_CLASSES, DetectionClass
from perception.evaluation.detection.reliability import Correctness, match_correctness
from perception.types import Detections, FusedDetections

CAR = KITTI_CLASSES[0]


@dataclass(frozen=True)
class FusedFrames:
    """Detections of F frames.

    Attributes:
        merged: Boxes of all modalities with the scores of their detectors.
        rescored: The same boxes with the scores of the fusion.
        fused: (F) detections, one for each object.
    """

    merged: DetectedBoxes
    rescored: DetectedBoxes
    fused: tuple[FusedDetections, ...]

    @property
    def boxes(self) -> DetectedBoxes:
        """Boxes of the last step."""
        return DetectedBoxes.of_frames([one.detections for one in self.fused])

    @property
    def steps(self) -> dict[str, DetectedBoxes]:
        """All steps by name."""
        return {"merged": self.merged, "rescored": self.rescored, "fused": self.boxes}


def fuse_frames(scenes: Sequence[DetectedScene], fusion: Fusion) -> FusedFrames:
    """Fuse frame by frame."""
    merged, rescored, fused = [], [], []
    for scene in scenes:
        merged.append(scene.merged.detections)
        if not len(merged[-1]):
            rescored.append(Detections.empty())
            fused.append(FusedDetections.empty())
            continue
        rescored_scene = fusion.rescore(scene)
        rescored.append(rescored_scene.detections)
        fused.append(fusion.join(scene, rescored_scene))
    return FusedFrames(
        DetectedBoxes.of_frames(merged), DetectedBoxes.of_frames(rescored), tuple(fused)
    )


def precision_curves(
    truth: TrueBoxes, detections: DetectedBoxes, frames: int, of_class: DetectionClass = CAR
) -> dict[str, PrecisionCurve]:
    """Return KITTI's precision curves by difficulty; none where nothing was detected."""
    return kitti_average_precision(pair_boxes(truth, detections, frames), (of_class,))[of_class]


def class_correctness(
    frames: DetectedFrames, detections: DetectedBoxes, class_names: Sequence[str]
) -> Correctness:
    """Return which detections of some classes are correct, by the IoU that KITTI requires of each class."""
    boxes = pair_boxes(frames.truth, detections, len(frames))
    known = {of_class.name: of_class for of_class in KITTI_CLASSES}
    parts = [
        match_correctness(boxes, known.get(name, DetectionClass(name, CAR.iou)))
        for name in class_names
    ]
    return Correctness(
        np.concatenate([part.scores for part in parts]),
        np.concatenate([part.is_correct for part in parts]),
    )


def boxes_by_detector(frames: DetectedFrames, fused: FusedFrames) -> dict[str, DetectedBoxes]:
    """Return the boxes of each modality that was detected in, and of the fusion."""
    return {str(name): frames.of_modality(name) for name in frames.modalities} | {
        "fusion": fused.boxes
    }


def curves_by_detector(
    frames: DetectedFrames, fused: FusedFrames, of_class: DetectionClass = CAR
) -> Mapping[str, dict[str, PrecisionCurve]]:
    """Return the curves of each modality that was detected in, and of the fusion."""
    return {
        name: precision_curves(frames.truth, boxes, len(frames), of_class)
        for name, boxes in boxes_by_detector(frames, fused).items()
    }
