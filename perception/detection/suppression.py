"""Several detections of one object: only the best stays (6.2.4)."""

import cv2
import numpy as np

from perception.types import Bool, Detections, Int

_ANY_SCORE = -1.0


def suppress(detections: Detections, max_iou: float) -> Int:
    """Return the rows that stay, best first: none overlaps a better one of its class that stays."""
    corner_px = detections.boxes_px[:, :2]
    size_px = detections.boxes_px[:, 2:] - corner_px
    # OpenCV would take all boxes without area for one and the same; they overlap nothing.
    rows = np.flatnonzero(size_px.prod(axis=1))
    stays: Bool = np.ones(len(size_px), bool)
    if len(rows):
        _, classes = np.unique(detections.types[rows], return_inverse=True)
        kept = cv2.dnn.NMSBoxesBatched(
            np.hstack([corner_px, size_px])[rows].tolist(),
            detections.scores[rows].tolist(),
            classes.tolist(),
            _ANY_SCORE,
            max_iou,
        )
        stays[rows] = False
        stays[rows[kept]] = True
    order = np.argsort(-detections.scores, kind="stable")
    return order[stays[order]]
