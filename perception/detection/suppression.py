"""Non-maximum suppression: of several detections of one object, keep the best (6.2.4)."""

import numpy as np

from perception.kernels.boxes import unsuppressed
from perception.types import Detections, Float64, Int


def suppress(detections: Detections, max_iou: float) -> Int:
    """Return the rows of the detections that are kept, best first.

    Args:
        detections: Detections of one image.
        max_iou: Overlap (IoU) with a kept detection of the same class above which a detection is suppressed.
    """
    _, classes = np.unique(detections.types, return_inverse=True)
    return suppress_boxes(detections.boxes_px, detections.scores, classes, max_iou)


def suppress_boxes(boxes_px: Float64, scores: Float64, classes: Int, max_iou: float) -> Int:
    """Return the rows of boxes that are kept, best first.

    Args:
        boxes_px: (M, 4) boxes x1 y1 x2 y2 of one image.
        scores: (M,) scores.
        classes: (M,) numbers of the classes.
        max_iou: Overlap (IoU) with a kept box of the same class above which a box is suppressed.
    """
    order = np.argsort(-scores, kind="stable")
    return order[unsuppressed(boxes_px[order], classes[order], max_iou)]
