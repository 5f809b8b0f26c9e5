"""Fusion without a network: non-maximum suppression over the detections of all modalities."""

import numpy as np

from perception.detection.config import NmsConfig
from perception.detection.suppression import suppress
from perception.geometry.box_overlap_px import iou_px
from perception.maps.densify import DenseMaps
from perception.types import (
    MODALITIES,
    Calibration,
    Detections,
    FusedDetections,
    Int,
    ModalityDetections,
)


class NmsFusion:
    """Non-maximum suppression over the detections of all modalities; implements `DetectionFusion`."""

    def __init__(self, max_iou: float = NmsConfig.max_iou) -> None:
        """Set the overlap (IoU) above which two boxes show the same object."""
        self._max_iou = max_iou

    def fuse(
        self,
        modality_detections: ModalityDetections,
        size_px: tuple[int, int],
        dense: DenseMaps | None = None,
        camera: Calibration | None = None,
    ) -> FusedDetections:
        """Return the kept detections, best first, each with the detections of the other modalities that it suppresses.

        Args:
            modality_detections: Detections by modality.
            size_px: (width, height) of the image; not used.
            dense: Dense maps of the frame; not used.
            camera: Calibration of the camera; not used.
        """
        by_column = [
            modality_detections.get(modality, Detections.empty()) for modality in MODALITIES
        ]
        counts = [len(found) for found in by_column]
        merged = Detections(
            np.concatenate([found.boxes_px for found in by_column]),
            np.concatenate([found.scores for found in by_column]),
            np.concatenate([found.types for found in by_column]),
        )
        kept = suppress(merged, self._max_iou)
        best = merged[kept]
        source_indices = np.stack(
            [_nearest_rows(best, found, self._max_iou) for found in by_column], axis=1
        )
        columns = np.repeat(np.arange(len(MODALITIES)), counts)
        return FusedDetections(best, np.asarray(source_indices, np.int64), columns[kept])


def _nearest_rows(best: Detections, found: Detections, max_iou: float) -> Int:
    """Return the (M,) row of the detection with the largest overlap with each of M best ones, or -1."""
    if not len(found):
        return np.full(len(best), -1)
    overlap = iou_px(best.boxes_px, found.boxes_px) * (best.types[:, None] == found.types)
    largest = overlap.argmax(axis=1)
    return np.where(overlap.max(axis=1) > max_iou, largest, -1)
