"""What three detectors say together while nothing weighs them: the best box of each place."""

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
    """All detections as one list, of which overlapping ones leave only the best."""

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
        """Return the best of each place; its parts are what the other detectors say of the same place.

        Args:
            modality_detections: what each detector saw.
            size_px: width and height of the image, which makes no difference here.
            dense: neither do the maps.
            camera: nor does it.
        """
        by_column = [
            modality_detections.get(modality, Detections.empty()) for modality in MODALITIES
        ]
        counts = [len(found) for found in by_column]
        together = Detections(
            np.concatenate([found.boxes_px for found in by_column]),
            np.concatenate([found.scores for found in by_column]),
            np.concatenate([found.types for found in by_column]),
        )
        kept = suppress(together, self._max_iou)
        best = together[kept]
        source_indices = np.stack(
            [_nearest_rows(best, found, self._max_iou) for found in by_column], axis=1
        )
        columns = np.repeat(np.arange(len(MODALITIES)), counts)
        return FusedDetections(best, np.asarray(source_indices, np.int64), columns[kept])


def _nearest_rows(best: Detections, found: Detections, max_iou: float) -> Int:
    """Return (M,) for each of M objects which detection of a modality shows it best, or -1."""
    if not len(found):
        return np.full(len(best), -1)
    overlap = iou_px(best.boxes_px, found.boxes_px) * (best.types[:, None] == found.types)
    nearest = overlap.argmax(axis=1)
    return np.where(overlap.max(axis=1) > max_iou, nearest, -1)
