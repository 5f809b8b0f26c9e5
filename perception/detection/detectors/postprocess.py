"""What a network answers for every place of a picture, reduced to the objects that it sees."""

from collections.abc import Sequence

import numpy as np

from perception.detection.detectors.input_size import InputSize
from perception.detection.suppression import suppress
from perception.types import Detections, Float

MIN_SCORE = 0.01
MAX_IOU = 0.5  # of two detections of one class (6.2.4)
# The best are compared with each other, and the best of these are kept. Measured with the three networks
# that ship: average precision stays within 0.3 points of keeping all of some 450, in a third of the time.
_MAX_PREDICTIONS = 300
MAX_OBJECTS = 64


def postprocess_detections(
    boxes_px: Float,
    scores: Float,
    class_names: Sequence[str],
    size: InputSize,
    min_score: float = MIN_SCORE,
) -> Detections:
    """Return the objects of one picture, best first and 64 at most, in pixels of the network's input.

    Overlap is the same before and after a picture is stretched, so that the choice may be made here.

    Args:
        boxes_px: (K, 4) x1 y1 x2 y2 of the places.
        scores: (K, classes) of them.
        class_names: in the order of the scores.
        size: of the input, at whose edges boxes end.
        min_score: what is less sure is left out.
    """
    places, classes = np.nonzero(scores >= max(min_score, _top_k_threshold(scores)))
    limits = np.tile([size.width_px, size.height_px], 2)
    within_px = np.clip(boxes_px[places].astype(np.float64), 0, limits)
    x1, y1, x2, y2 = within_px.T
    rows = np.flatnonzero((x2 > x1) & (y2 > y1))
    confidences = scores[places, classes].astype(np.float64)
    best = rows[np.argsort(-confidences[rows], kind="stable")[:_MAX_PREDICTIONS]]
    found = Detections(
        within_px[best], confidences[best], np.array(class_names, np.str_)[classes[best]]
    )
    return found[suppress(found, MAX_IOU)[:MAX_OBJECTS]]


def _top_k_threshold(scores: Float) -> float:
    """Return a score that no more than the best answers are above."""
    if scores.size <= _MAX_PREDICTIONS:
        return 0.0
    return float(np.partition(scores, -_MAX_PREDICTIONS, axis=None)[-_MAX_PREDICTIONS])
