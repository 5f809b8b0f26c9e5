"""Non-maximum suppression: of several detections of one object, keep the best (6.2.4)."""

import cv2
import numpy as np

from perception.types import Bool, Detections, Float64, Int

_ANY_SCORE = -1.0


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
    corner_and_size_px = boxes_px.copy()
    corner_and_size_px[:, 2:] -= boxes_px[:, :2]
    # OpenCV would treat all boxes without area as one; they overlap nothing.
    rows = np.flatnonzero(corner_and_size_px[:, 2] * corner_and_size_px[:, 3])
    is_kept: Bool = np.ones(len(boxes_px), bool)
    if len(rows):
        kept = cv2.dnn.NMSBoxesBatched(
            corner_and_size_px[rows].tolist(),
            scores[rows].tolist(),
            classes[rows].tolist(),
            _ANY_SCORE,
            max_iou,
        )
        is_kept[rows] = False
        is_kept[rows[kept]] = True
    order = np.argsort(-scores, kind="stable")
    return order[is_kept[order]]
