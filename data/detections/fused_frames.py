"""What a fusion makes of detected frames, step by step (Fig. 7.14), and what each step is worth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from data.detections.detected_frames import DetectedFrames
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.rescoring import Fusion
from perception.evaluation.detection.average_precision import kitti_average_precision
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.precision_curve import PrecisionCurve
from perception.evaluation.detection.protocol import KITTI_CLASSES, DetectionClass
from perception.evaluation.detection.reliability import Correctness, match_correctness
from perception.types import MODALITIES, Detections, FusedDetections

CAR = KITTI_CLASSES[0]


@dataclass(frozen=True)
class FusedFrames:
    """Detections of F frames.

    Attributes:
        merged: boxes of all modalities, with the scores of their detectors.
        rescored: the same boxes, with their new scores.
        fused: (F) one detection for each object.
    """

    merged: DetectedBoxes
    rescored: DetectedBoxes
    fused: tuple[FusedDetections, ...]

    @property
    def boxes(self) -> DetectedBoxes:
        """What is left at the end."""
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
        judged = fusion.rescore(scene)
        rescored.append(judged.detections)
        fused.append(fusion.join(scene, judged))
    return FusedFrames(
        DetectedBoxes.of_frames(merged), DetectedBoxes.of_frames(rescored), tuple(fused)
    )


def precision_curves(
    truth: TrueBoxes, detections: DetectedBoxes, frames: int, of_class: DetectionClass = CAR
) -> dict[str, PrecisionCurve]:
    """Return KITTI's curves by difficulty; none where nothing was detected."""
    metrics = kitti_average_precision(truth, detections, frames, (of_class,))
    return metrics.classes[0].curves


def judged(
    frames: DetectedFrames, detections: DetectedBoxes, class_names: Sequence[str]
) -> Correctness:
    """Tell which detections of some classes are right, each by the overlap that KITTI asks of its class."""
    known = {of_class.name: of_class for of_class in KITTI_CLASSES}
    parts = [
        match_correctness(
            frames.truth, detections, len(frames), known.get(name, DetectionClass(name, CAR.iou))
        )
        for name in class_names
    ]
    return Correctness(
        np.concatenate([part.scores for part in parts]),
        np.concatenate([part.is_correct for part in parts]),
    )


def boxes_beside(frames: DetectedFrames, fused: FusedFrames) -> dict[str, DetectedBoxes]:
    """Return what each modality that looked sees by itself, and what the fusion says."""
    present = [
        name
        for name in MODALITIES
        if any(name in scene.modality_detections for scene in frames.scenes)
    ]
    return {str(name): frames.of_modality(name) for name in present} | {"fusion": fused.boxes}


def curves_beside(
    frames: DetectedFrames, fused: FusedFrames, of_class: DetectionClass = CAR
) -> Mapping[str, dict[str, PrecisionCurve]]:
    """Return the curves of each modality that looked, and of the fusion."""
    return {
        name: precision_curves(frames.truth, boxes, len(frames), of_class)
        for name, boxes in boxes_beside(frames, fused).items()
    }
