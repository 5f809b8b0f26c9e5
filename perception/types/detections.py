"""Detections in the camera image, in the maps made of the scan, and their fusion."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray

from perception.types.table import ArrayTable, Float64, Int

# Input of a detector: the camera image, the depth map, or the reflectance map.
Modality = Literal["rgb", "dm", "rm"]
MODALITIES: tuple[Modality, ...] = get_args(Modality)
# The modalities that are made of the scan.
MapModality = Literal["dm", "rm"]
MAP_MODALITIES: tuple[MapModality, ...] = get_args(MapModality)


@dataclass(frozen=True)
class Detections(ArrayTable):
    """M detections in one image.

    Attributes:
        boxes_px: (M, 4) x1 y1 x2 y2.
        scores: (M,) 0..1.
        types: (M,) class names, spelled as in labels: Car ...
    """

    boxes_px: Annotated[Float64, 4]
    scores: Float64
    types: NDArray[np.str_]


# What the pipeline detects in: one of these images, or the scan from above.
DetectorModality = Literal["rgb", "dm", "rm", "bev"]
DETECTOR_MODALITIES: tuple[DetectorModality, ...] = get_args(DetectorModality)
# Detections by modality; a modality whose detector did not run has no entry.
ModalityDetections = Mapping[Modality, Detections]


@dataclass(frozen=True)
class FusedDetections(ArrayTable):
    """M fused detections, best first, and the detections that they come from.

    Attributes:
        detections: (M)
        source_indices: (M, 3) row in the detections of each of `MODALITIES`, -1 where that detector has none.
        dominant_modality: (M,) column of the modality with the largest contribution.
        existence: (M,) probability, 0..1, that the object exists, by its whole track or by a single detection.
    """

    detections: Detections
    source_indices: Annotated[Int, len(MODALITIES)]
    dominant_modality: Int
    existence: Float64

    @classmethod
    def unfused(cls, detections: Detections) -> Self:
        """Return detections that come from no detector of a modality, such as those of DepthCN."""
        count = len(detections)
        sources = np.full((count, len(MODALITIES)), -1)
        return cls(detections, sources, np.full(count, -1), detections.scores)
