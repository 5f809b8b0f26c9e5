"""Fusion without a network: non-maximum suppression over the detections of all modalities."""

import numpy as np

from perception.detection.config import NmsConfig
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.existence import existence_of
from perception.detection.suppression import suppress
from perception.geometry.box_overlap_px import iou_px
from perception.types import MODALITIES, Detections, FusedDetections, Int


class NmsFusion:
    """Non-maximum suppression over the detections of all modalities; a `DetectionFusion`."""

    def __init__(self, max_iou: float = NmsConfig.max_iou) -> None:
        """Set the overlap (IoU) above which two boxes show the same object."""
        self._max_iou = max_iou

    def fuse(self, scene: DetectedScene) -> FusedDetections:
        """Return the kept detections, best first, each with the detections of the other modalities that it suppresses."""
        merged = scene.merged
        kept = suppress(merged.detections, self._max_iou)
        best = merged.detections[kept]
        source_indices = [
            _nearest_rows(
                best, scene.modality_detections.get(name, Detections.empty()), self._max_iou
            )
            for name in MODALITIES
        ]
        return FusedDetections(
            best,
            np.asarray(np.stack(source_indices, axis=1), np.int64),
            merged.columns[kept],
            existence_of(best.scores, scene.set_names(best.types), best.types),
        )


def _nearest_rows(best: Detections, found: Detections, max_iou: float) -> Int:
    """Return the (M,) row of the detection with the largest overlap with each of M best ones, or -1."""
    if not len(found):
        return np.full(len(best), -1)
    overlap = iou_px(best.boxes_px, found.boxes_px) * (best.types[:, None] == found.types)
    largest = overlap.argmax(axis=1)
    return np.where(overlap.max(axis=1) > max_iou, largest, -1)
