"""Non-maximum suppression: of several detections of one object, keep the best (6.2.4)."""

import cv2
import numpy as np

from perception.types import Bool, Detections, Int

_ANY_SCORE = -1.0


def suppress(detections: Detections, max_iou: float) -> Int:
    """Return the rows of the detections that are kept, best first.

    Args:
        detections: Detections of one image.
        max_iou: Overlap (IoU) with a kept detection of the same class above which a detection is suppressed.
    """
    corner_px = detections.boxes_px[:, :2]
    size_px = detections.boxes_px[:, 2:] - corner_px
    # OpenCV would treat all boxes without area as one; they overlap nothing.
    rows = np.flatnonzero(size_px.prod(axis=1))
    is_kept: Bool = np.ones(len(size_px), bool)
    if len(rows):
        _, classes = np.unique(detections.types[rows], return_inverse=True)
        kept = cv2.dnn.NMSBoxesBatched(
            np.hstack([corner_px, size_px])[rows].tolist(),
            detections.scores[rows].tolist(),
            classes.tolist(),
            _ANY_SCORE,
            max_iou,
        )
        is_kept[rows] = False
        is_kept[rows[kept]] = True
    order = np.argsort(-detections.scores, kind="stable")
    return order[is_kept[order]]
