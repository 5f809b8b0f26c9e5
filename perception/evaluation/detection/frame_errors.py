"""In which frames a detector errs, at the score at which it errs least in all of them together."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.match_statistics import match_statistics
from perception.evaluation.detection.protocol import DetectionClass, Difficulty
from perception.types import Int


@dataclass(frozen=True)
class FrameErrors:
    """Of one class at one difficulty.

    Attributes:
        threshold: detections of this score and above count.
        false_negatives: (F,) objects of each frame that none of them finds.
        false_positives: (F,) of them that find nothing.
    """

    threshold: float
    false_negatives: Int
    false_positives: Int

    def worst(self, most: int) -> Int:
        """Return up to so many frames with mistakes, those with most of them first."""
        together = self.false_negatives + self.false_positives
        order = np.argsort(-together, kind="stable")
        return order[together[order] > 0][:most]


def count_frame_errors(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    of_class: DetectionClass,
    difficulty: Difficulty,
) -> FrameErrors:
    """Count at the score at which misses and false alarms of all frames together are fewest.

    Raises:
        PerceptionError: a box is of a frame beyond the last.
    """
    counted = match_statistics(pair_boxes(truths, detections, frames), of_class, difficulty)
    increments = counted.increments
    gained = np.cumsum(increments.found_truths - increments.false_positives)
    # Of equal scores all count or none.
    last_of_score = np.flatnonzero(np.diff(increments.scores, append=-np.inf))
    threshold = np.inf
    if len(last_of_score) and gained[last_of_score].max() > 0:
        threshold = increments.scores[last_of_score[gained[last_of_score].argmax()]]
    above = increments[increments.scores >= threshold]
    found = np.bincount(above.frames, above.found_truths, minlength=frames)
    alarms = np.bincount(above.frames, above.false_positives, minlength=frames)
    return FrameErrors(
        threshold=float(threshold),
        false_negatives=np.asarray(counted.truths_of_frames - found, np.int64),
        false_positives=np.asarray(alarms, np.int64),
    )
