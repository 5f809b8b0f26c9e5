"""Errors of a detector by frame, at the score threshold with the fewest errors in all frames together."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.evaluation.detection.evaluation_boxes import EvaluationBoxes, evaluation_mask
from perception.evaluation.detection.match_statistics import match_statistics
from perception.evaluation.detection.protocol import DIFFICULTIES, DetectionClass, Difficulty
from perception.types import Float64, Int


@dataclass(frozen=True)
class FrameErrors:
    """Errors of one class at one difficulty.

    Attributes:
        threshold: Lowest score of the detections that count.
        false_negatives: (F,) number of missed objects of each frame.
        false_positives: (F,) number of detections of each frame that match no object.
    """

    threshold: float
    false_negatives: Int
    false_positives: Int

    def worst(self, count: int) -> Int:
        """Return the frames with most errors, at most `count`, the worst first; none without an error."""
        together = self.false_negatives + self.false_positives
        order = np.argsort(-together, kind="stable")
        return order[together[order] > 0][:count]


def count_frame_errors(
    boxes: EvaluationBoxes, detection_class: DetectionClass, difficulty: Difficulty
) -> FrameErrors:
    """Count the errors at the score threshold with the fewest errors of all frames together."""
    counted = match_statistics(boxes, detection_class, difficulty)
    increments = counted.increments
    gained = np.cumsum(increments.found_truths - increments.false_positives)
    # Of equal scores all count or none.
    last_of_score = np.flatnonzero(np.diff(increments.scores, append=-np.inf))
    threshold = np.inf
    if len(last_of_score) and gained[last_of_score].max() > 0:
        threshold = increments.scores[last_of_score[gained[last_of_score].argmax()]]
    above = increments[increments.scores >= threshold]
    found = np.bincount(above.frames, above.found_truths, minlength=boxes.frames)
    alarms = np.bincount(above.frames, above.false_positives, minlength=boxes.frames)
    return FrameErrors(
        threshold=float(threshold),
        false_negatives=np.asarray(counted.truths_of_frames - found, np.int64),
        false_positives=np.asarray(alarms, np.int64),
    )


@dataclass(frozen=True)
class ErrorFrame:
    """A frame with errors, as it is drawn.

    Attributes:
        place: Place of the frame among those evaluated.
        objects_px: (M, 4) objects that must be detected.
        ignored_px: (K, 4) boxes that may be detected: other difficulties and classes, DontCare regions.
        detections: Detections from the threshold on.
    """

    place: int
    objects_px: Float64
    ignored_px: Float64
    detections: DetectedBoxes


def worst_frames(
    boxes: EvaluationBoxes, detection_class: DetectionClass, count: int
) -> list[ErrorFrame]:
    """Return the frames with most errors at the hardest difficulty, the worst first."""
    truths, detections, difficulty = boxes.truths, boxes.detections, DIFFICULTIES[-1]
    errors = count_frame_errors(boxes, detection_class, difficulty)
    mask = evaluation_mask(boxes, detection_class, difficulty)
    counts = (detections.scores >= errors.threshold) & (
        boxes.detection_types == detection_class.name.lower()
    )
    worst = []
    for place in errors.worst(count).tolist():
        in_frame = truths.frames == place
        worst.append(
            ErrorFrame(
                place,
                truths.boxes_px[in_frame & mask.is_valid_truth],
                truths.boxes_px[in_frame & ~mask.is_valid_truth],
                detections[counts & (detections.frames == place)],
            )
        )
    return worst
