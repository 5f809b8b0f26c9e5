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


@dataclass(frozen=True)
class ClassMetrics:
    """Metrics of one class.

    Attributes:
        detection_class: Class and its IoU threshold.
        curves: Precision-recall curves by difficulty; empty where nothing of the class was detected.
    """

    detection_class: DetectionClass
    curves: dict[str, PrecisionCurve]


@dataclass(frozen=True)
class DetectionMetrics:
    """Metrics of all classes.

    Attributes:
        frames: Number of frames.
        classes: Metrics of each class.
    """

    frames: int
    classes: tuple[ClassMetrics, ...]


@dataclass(frozen=True)
class DetectionStatistics:
    """Matches of all classes, from which the metrics of any bootstrap resample follow.

    Attributes:
        frames: Number of frames.
        has_orientation: Whether every detection has a heading.
        classes: Classes with their IoU thresholds.
        statistics: Matches of each class by difficulty; empty where nothing of the class was detected.
    """

    frames: int
    has_orientation: bool
    classes: tuple[DetectionClass, ...]
    statistics: tuple[dict[str, MatchStatistics], ...]

    def metrics(self, frame_weights: Int | None = None) -> DetectionMetrics:
        """Return the metrics of all frames, or of a resample with (F,) multiplicities of the frames."""
        return DetectionMetrics(
            frames=self.frames,
            classes=tuple(
                ClassMetrics(
                    detection_class,
                    {
                        name: compute_curve(
                            of_difficulty,
                            has_orientation=self.has_orientation,
                            frame_weights=frame_weights,
                        )
                        for name, of_difficulty in statistics.items()
                    },
                )
                for detection_class, statistics in zip(self.classes, self.statistics, strict=True)
            ),
        )


def match_detections(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    classes: Sequence[DetectionClass] = KITTI_CLASSES,
    difficulties: Sequence[Difficulty] = DIFFICULTIES,
) -> DetectionStatistics:
    """Match the boxes of all frames for every class and difficulty.

    Raises:
        PerceptionError: a box is of a frame beyond the last.
    """
    evaluation_boxes = pair_boxes(truths, detections, frames)
    return DetectionStatistics(
        frames=frames,
        has_orientation=evaluation_boxes.has_orientation,
        classes=tuple(classes),
        statistics=tuple(
            {
                one.name: match_statistics(evaluation_boxes, detection_class, one)
                for one in difficulties
            }
            if evaluation_boxes.has_detections_of(detection_class)
            else {}
            for detection_class in classes
        ),
    )


def kitti_average_precision(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    classes: Sequence[DetectionClass] = KITTI_CLASSES,
    difficulties: Sequence[Difficulty] = DIFFICULTIES,
) -> DetectionMetrics:
    """Return the average precision of detections by KITTI's 2D protocol.

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
    return match_detections(truths, detections, frames, classes, difficulties).metrics()
