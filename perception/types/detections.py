"""What detectors see in the views of the road, each by itself and together."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray

from perception.types.arrays import Bool, Float64, Int, require_shape

# A view of the road that a detector looks at: the camera's image, the depth map, the reflectance map.
Modality = Literal["rgb", "dm", "rm"]
MODALITIES: tuple[Modality, ...] = get_args(Modality)
# Those of them that are made of the LiDAR's returns.
MapModality = Literal["dm", "rm"]
MAP_MODALITIES: tuple[MapModality, ...] = get_args(MapModality)


@dataclass(frozen=True)
class Detections:
    """M objects that a detector sees in one image.

    Attributes:
        boxes_px: (M, 4) x1 y1 x2 y2.
        scores: (M,) 0..1.
        types: (M,) class names, spelled as in labels: Car ...
    """

    boxes_px: Float64
    scores: Float64
    types: NDArray[np.str_]

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        require_shape("Detections.boxes_px", self.boxes_px, ("M", 4))
        require_shape("Detections.scores", self.scores, (len(self.boxes_px),))
        require_shape("Detections.types", self.types, (len(self.boxes_px),))

    def __len__(self) -> int:
        """Return M."""
        return len(self.boxes_px)

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the detections of a mask, of indices, or of a slice."""
        return type(self)(self.boxes_px[rows], self.scores[rows], self.types[rows])

    @classmethod
    def empty(cls) -> Self:
        """Return no detections."""
        return cls(np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.str_))


# What the detector of each modality sees; one that did not look has no entry.
ModalityDetections = Mapping[Modality, Detections]


@dataclass(frozen=True)
class FusedDetections:
    """M objects after joint rescoring, best first, and what they were made of.

    Attributes:
        detections: (M)
        source_indices: (M, 3) row in the detections of each of `MODALITIES`, -1 where that detector saw nothing.
        dominant_modality: (M,) column of the modality that carried the detection most.
    """

    detections: Detections
    source_indices: Int
    dominant_modality: Int

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        count = len(self.detections)
        require_shape("FusedDetections.parts", self.source_indices, (count, len(MODALITIES)))
        require_shape("FusedDetections.carriers", self.dominant_modality, (count,))

    def __len__(self) -> int:
        """Return M."""
        return len(self.detections)

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the detections of a mask, of indices, or of a slice."""
        return type(self)(
            self.detections[rows], self.source_indices[rows], self.dominant_modality[rows]
        )

    @classmethod
    def empty(cls) -> Self:
        """Return no detections."""
        return cls(
            Detections.empty(), np.zeros((0, len(MODALITIES)), np.int64), np.zeros(0, np.int64)
        )
