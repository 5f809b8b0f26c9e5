"""In which frames a detector errs, at the score at which it errs least in all of them together."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.protocol import DetectionClass, Difficulty
from perception.evaluation.detection.scene import lay_out
from perception.evaluation.detection.tally import tally
from perception.types import Int


@dataclass(frozen=True)
class Mistakes:
    """Of one class at one difficulty.

    Attributes:
        threshold: detections of this score and above count.
        misses: (F,) objects of each frame that none of them finds.
        false_alarms: (F,) of them that find nothing.
    """

    threshold: float
    misses: Int
    false_alarms: Int

    def worst(self, most: int) -> Int:
        """Return up to so many frames with mistakes, those with most of them first."""
        together = self.misses + self.false_alarms
        order = np.argsort(-together, kind="stable")
        return order[together[order] > 0][:most]


def count_mistakes(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    of_class: DetectionClass,
    difficulty: Difficulty,
) -> Mistakes:
    """Count at the score at which misses and false alarms of all frames together are fewest.

    Raises:
        PerceptionError: a box is of a frame beyond the last.
    """
    counted = tally(lay_out(truths, detections, frames), of_class, difficulty)
    changes = counted.changes
    gained = np.cumsum(changes.found_truths - changes.false_positives)
    # Of equal scores all count or none.
    last_of_score = np.flatnonzero(np.diff(changes.scores, append=-np.inf))
    threshold = np.inf
    if len(last_of_score) and gained[last_of_score].max() > 0:
        threshold = changes.scores[last_of_score[gained[last_of_score].argmax()]]
    above = changes[changes.scores >= threshold]
    found = np.bincount(above.frames, above.found_truths, minlength=frames)
    alarms = np.bincount(above.frames, above.false_positives, minlength=frames)
    return Mistakes(
        threshold=float(threshold),
        misses=np.asarray(counted.truths_of_frames - found, np.int64),
        false_alarms=np.asarray(alarms, np.int64),
    )
