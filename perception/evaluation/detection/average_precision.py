"""KITTI's measure of detection: every class at every difficulty."""

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
    """One class.

    Attributes:
        of_class: which, and at which overlap.
        curves: by name of the difficulty; empty where nothing was detected of this class.
    """

    of_class: DetectionClass
    curves: dict[str, PrecisionCurve]


@dataclass(frozen=True)
class DetectionMetrics:
    """All classes.

    Attributes:
        frames: that the figures rest on.
        classes: in the order asked for.
    """

    frames: int
    classes: tuple[ClassMetrics, ...]


@dataclass(frozen=True)
class DetectionStatistics:
    """All that matching found, from which the figures of any choice of frames follow.

    Attributes:
        frames: how many there are.
        has_orientation: whether every detection tells its heading.
        classes: in the order asked for.
        statistics: for each class, by name of the difficulty; empty where nothing was detected of it.
    """

    frames: int
    has_orientation: bool
    classes: tuple[DetectionClass, ...]
    statistics: tuple[dict[str, MatchStatistics], ...]

    def metrics(self, frame_weights: Int | None = None) -> DetectionMetrics:
        """Return the figures of all frames, or of a choice in which each is so often."""
        return DetectionMetrics(
            frames=self.frames,
            classes=tuple(
                ClassMetrics(
                    of_class,
                    {
                        name: compute_curve(
                            of_difficulty,
                            has_orientation=self.has_orientation,
                            frame_weights=frame_weights,
                        )
                        for name, of_difficulty in statistics.items()
                    },
                )
                for of_class, statistics in zip(self.classes, self.statistics, strict=True)
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
            {one.name: match_statistics(evaluation_boxes, of_class, one) for one in difficulties}
            if evaluation_boxes.has_detections_of(of_class)
            else {}
            for of_class in classes
        ),
    )


def kitti_average_precision(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    classes: Sequence[DetectionClass] = KITTI_CLASSES,
    difficulties: Sequence[Difficulty] = DIFFICULTIES,
) -> DetectionMetrics:
    """Measure detections as KITTI's object benchmark does.

    A class of which nothing was detected has no figures, as with the official tool; a class that was
    never labelled has an average precision of 0 that rests on 0 truths.

    Args:
        truths: labelled boxes of all frames.
        detections: detected boxes of all frames.
        frames: how many there are, with boxes or without.
        classes: what to look for, and from which overlap on.
        difficulties: which objects count.

    Raises:
        PerceptionError: a box is of a frame beyond the last.
    """
    return match_detections(truths, detections, frames, classes, difficulties).metrics()
