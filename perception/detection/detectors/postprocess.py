"""Objects from what a network predicts at every position of its input."""

from collections.abc import Sequence

import numpy as np

from perception.detection.config import DEFAULT_NMS, NmsConfig
from perception.detection.detectors.input_size import InputSize
from perception.detection.suppression import suppress
from perception.types import Detections, Float


def postprocess_detections(
    boxes_px: Float,
    scores: Float,
    class_names: Sequence[str],
    size: InputSize,
    nms: NmsConfig = DEFAULT_NMS,
) -> Detections:
    """Return the objects of one image, best first, in pixels of the network's input.

    Stretching an image does not change overlaps, so that boxes are suppressed before they are scaled back.

    Args:
        boxes_px: (K, 4) predicted boxes x1 y1 x2 y2.
        scores: (K, classes) predicted scores.
        class_names: Class names in the order of the scores.
        size: Input size, to which boxes are clipped.
        nms: Score threshold and suppression.
    """
    threshold = max(nms.min_score, _top_k_threshold(scores, nms.max_candidates))
    positions, classes = np.nonzero(scores >= threshold)
    limits = np.tile([size.width_px, size.height_px], 2)
    within_px = np.clip(boxes_px[positions].astype(np.float64), 0, limits)
    x1, y1, x2, y2 = within_px.T
    rows = np.flatnonzero((x2 > x1) & (y2 > y1))
    confidences = scores[positions, classes].astype(np.float64)
    best = rows[np.argsort(-confidences[rows], kind="stable")[: nms.max_candidates]]
    candidates = Detections(
        within_px[best], confidences[best], np.array(class_names, np.str_)[classes[best]]
    )
    return candidates[suppress(candidates, nms.max_iou)[: nms.max_detections]]


def _top_k_threshold(scores: Float, count: int) -> float:
    """Return a score that at most the count best predictions exceed."""
    if scores.size <= count:
        return 0.0
    return float(np.partition(scores, -count, axis=None)[-count])
