"""What detectors see in the views of the road, each by itself and together."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from perception.types.arrays import Float64, Int
from perception.types.table import ArrayTable

# A view of the road that a detector looks at: the camera's image, the depth map, the reflectance map.
Modality = Literal["rgb", "dm", "rm"]
MODALITIES: tuple[Modality, ...] = get_args(Modality)
# Those of them that are made of the LiDAR's returns.
MapModality = Literal["dm", "rm"]
MAP_MODALITIES: tuple[MapModality, ...] = get_args(MapModality)


@dataclass(frozen=True)
class Detections(ArrayTable):
    """M objects that a detector sees in one image.

    Attributes:
        boxes_px: (M, 4) x1 y1 x2 y2.
        scores: (M,) 0..1.
        types: (M,) class names, spelled as in labels: Car ...
    """

    boxes_px: Annotated[Float64, 4]
    scores: Float64
    types: NDArray[np.str_]


# What the detector of each modality sees; one that did not look has no entry.
ModalityDetections = Mapping[Modality, Detections]


@dataclass(frozen=True)
class FusedDetections(ArrayTable):
    """M objects after joint rescoring, best first, and what they were made of.

    Attributes:
        detections: (M)
        source_indices: (M, 3) row in the detections of each of `MODALITIES`, -1 where that detector saw nothing.
        dominant_modality: (M,) column of the modality that carried the detection most.
    """

    detections: Detections
    source_indices: Annotated[Int, len(MODALITIES)]
    dominant_modality: Int
