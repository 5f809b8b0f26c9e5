"""Average precision by KITTI's 2D protocol: every class at every difficulty."""

from collections.abc import Sequence
from dataclasses import dataclass

from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.match_statistics import MatchStatistics, match_statistics
from perception.evaluation.detection.precision_curve import PrecisionCurve, compute_curve
from perception.evaluation.detection.protocol import (
    DIFFICULTIES,
    KITTI_CLASSES,
    DetectionClass,
    Difficulty,
)
from perception.types import Int

# Precision-recall curves by difficulty; none where nothing of the class was detected.
ClassCurves = dict[str, PrecisionCurve]
DetectionMetrics = dict[DetectionClass, ClassCurves]


@dataclass(frozen=True)
class ClassMatches:
    """Matches of one class in all frames, from which the curves of any bootstrap resample follow.

    Attributes:
        frames: Number of frames.
        has_orientation: Whether every detection, of any class, has a heading.
        by_difficulty: Matches by difficulty; none where nothing of the class was detected.
    """

    frames: int
    has_orientation: bool
    by_difficulty: dict[str, MatchStatistics]

    def curves(self, frame_weights: Int | None = None) -> ClassCurves:
        """Return the curves of all frames, or of a resample with (F,) multiplicities of the frames."""
        return {
            name: compute_curve(
                matches, has_orientation=self.has_orientation, frame_weights=frame_weights
            )
            for name, matches in self.by_difficulty.items()
        }


def match_detections(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    classes: Sequence[DetectionClass] = KITTI_CLASSES,
    difficulties: Sequence[Difficulty] = DIFFICULTIES,
) -> dict[DetectionClass, ClassMatches]:
    """Match the boxes of all frames for every class and difficulty.

    Raises:
        PerceptionError: a box is of a frame beyond the last.
    """
    boxes = pair_boxes(truths, detections, frames)
    matches = {}
    for of_class in classes:
        found = difficulties if boxes.has_detections_of(of_class) else ()
        statistics = {one.name: match_statistics(boxes, of_class, one) for one in found}
        matches[of_class] = ClassMatches(frames, boxes.has_orientation, statistics)
    return matches


def kitti_average_precision(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    classes: Sequence[DetectionClass] = KITTI_CLASSES,
    difficulties: Sequence[Difficulty] = DIFFICULTIES,
) -> DetectionMetrics:
    """Return the precision-recall curves of each class by KITTI's 2D protocol.

    As with the official tool, a class without detections has no metrics, and a class without labels has an
    average precision of 0.

    Args:
        truths: Labelled boxes of all frames.
        detections: Detected boxes of all frames.
        frames: Number of frames, with boxes or without.
        classes: Classes with their IoU thresholds.
        difficulties: Difficulties, each with its limits.

    Raises:
        PerceptionError: a box is of a frame beyond the last.
    """
    matches = match_detections(truths, detections, frames, classes, difficulties)
    return {of_class: one.curves() for of_class, one in matches.items()}
