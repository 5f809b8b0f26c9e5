"""Boxes of all modalities that show the same object, at most one of each modality, and the box that they agree on.

Example: rgb 0 overlaps dm 0 and dm 1, dm 1 more than dm 0; rm 0 overlaps none:

    rgb  dm  rm
      0   1  -1
     -1   0  -1
     -1  -1   0
"""

import numpy as np

from perception.detection.fusion.detected_scene import DetectedScene
from perception.tracking.association import assign_with_max_cost
from perception.types import MODALITIES, Float64, Int

_MIN_ERROR = 0.02  # smallest error of a box; labels are no better
# Weights of boxes of equal scores, for each of `MODALITIES`. Depth and reflectance are of the same returns, and the
# errors of their boxes go together; chosen by overlaps with the labels of synthetic frames.
_SHARES = np.array([1.0, 0.7, 0.25])


def matched_boxes(scene: DetectedScene, min_iou: float) -> Int:
    """Return the (T, 3) rows in the detections of each of `MODALITIES`, -1 where a modality has no box.

    Each box is in one row. Boxes of one class are matched one to one, with the largest sum of overlaps: those of the
    second modality with those of the first, then those of the third with either.

    Args:
        scene: Detections of one frame.
        min_iou: Overlap (IoU) above which boxes of two modalities may show the same object.
    """
    merged = scene.merged
    overlap = np.where(merged.is_same_class & (merged.iou > min_iou), merged.iou, 0.0)
    # The last row is of missing boxes.
    overlap = np.vstack([overlap, np.zeros(len(merged.detections))])
    places = np.full((0, len(MODALITIES)), -1)
    for column in range(len(MODALITIES)):
        boxes = np.flatnonzero(merged.columns == column)
        gains = overlap[:, boxes][places[:, :column]].max(axis=1, initial=0.0)
        pairs = assign_with_max_cost(-gains, gains > 0, 0.0)
        places[pairs.tracks, column] = boxes[pairs.detections]
        left = boxes[pairs.unmatched_detections]
        alone = np.full((len(left), len(MODALITIES)), -1)
        alone[:, column] = left
        places = np.vstack([places, alone])
    return np.where(places >= 0, places - merged.starts, -1)


def box_weights(scene: DetectedScene, rows: Int) -> Float64:
    """Return the (T, 3) weights of the boxes of (T, 3) rows, 0 where there is no box; those of a row sum to 1.

    The error of a box is taken as proportional to 1 - score, and its weight as the inverse square.
    """
    scores = np.append(scene.merged.detections.scores, 0.0)[scene.merged.places(rows)]
    weights = np.where(rows >= 0, _SHARES * np.maximum(1 - scores, _MIN_ERROR) ** -2, 0.0)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def blended_boxes_px(scene: DetectedScene, rows: Int) -> Float64:
    """Return the (T, 4) weighted means of the boxes of (T, 3) rows."""
    boxes_px = scene.merged.detections.boxes_px[scene.merged.places(rows)]
    return np.asarray((box_weights(scene, rows)[..., None] * boxes_px).sum(axis=1))
