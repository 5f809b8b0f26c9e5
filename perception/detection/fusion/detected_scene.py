"""Detections of all modalities in one frame."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from perception.geometry.box_overlap_px import iou_px
from perception.types import (
    MODALITIES,
    Bool,
    Detections,
    Float64,
    Int,
    Modality,
    ModalityDetections,
)

# Two of them or more can be fused.
MIN_FUSED = 2
# Names of the classes that the detector of each modality knows.
DetectorClasses = Mapping[Modality, tuple[str, ...]]


@dataclass(frozen=True)
class MergedDetections:
    """M boxes of all modalities in the order of `MODALITIES`.

    Attributes:
        detections: (M) detections of all modalities.
        columns: (M,) index in `MODALITIES` of the modality of each box.
        starts: (3,) index of the first box of each modality; a box is at its start plus its row there.
    """

    detections: Detections
    columns: Int
    starts: Int

    @cached_property
    def iou(self) -> Float64:
        """(M, M) overlap of every two boxes."""
        return iou_px(self.detections.boxes_px, self.detections.boxes_px)

    @cached_property
    def is_same_class(self) -> Bool:
        """(M, M) mask of every two boxes of one class."""
        _, classes = np.unique(self.detections.types, return_inverse=True)
        return np.asarray(classes[:, None] == classes)

    def places(self, tri_boxes: Int) -> Int:
        """Return the (T, 3) indices of the boxes of (T, 3) combinations among the M, -1 where there is none."""
        return np.where(tri_boxes >= 0, tri_boxes + self.starts, -1)


@dataclass(frozen=True)
class DetectedScene:
    """Detections in one frame.

    Attributes:
        modality_detections: Detections by modality; a detector that did not run has no entry.
        size_px: (width, height) of the image.
        class_names: Classes that the detector of each modality knows; one without an entry knows all.
    """

    modality_detections: ModalityDetections
    size_px: tuple[int, int]
    class_names: DetectorClasses = field(default_factory=dict)

    @cached_property
    def merged(self) -> MergedDetections:
        """All boxes, with the scores of their detectors."""
        parts = [
            self.modality_detections.get(modality, Detections.empty()) for modality in MODALITIES
        ]
        counts = [len(part) for part in parts]
        return MergedDetections(
            Detections(
                np.concatenate([part.boxes_px for part in parts]),
                np.concatenate([part.scores for part in parts]),
                np.concatenate([part.types for part in parts]),
            ),
            columns=np.repeat(np.arange(len(parts)), counts),
            starts=np.cumsum([0, *counts[:-1]]),
        )

    def searched(self, types: NDArray[np.str_]) -> Bool:
        """Return the (T, 3) mask of the modalities whose detector ran and knows each of (T,) classes."""
        is_searched = np.zeros((len(types), len(MODALITIES)), bool)
        for column, name in enumerate(MODALITIES):
            if name in self.modality_detections:
                known = self.class_names.get(name)
                is_searched[:, column] = True if known is None else np.isin(types, known)
        return is_searched

    def set_names(self, types: NDArray[np.str_]) -> NDArray[np.str_]:
        """Return the (T,) set of the modalities that were searched for each of (T,) classes, such as `dm+rm`."""
        names = np.array(
            [
                "+".join(name for column, name in enumerate(MODALITIES) if code >> column & 1)
                for code in range(2 ** len(MODALITIES))
            ]
        )
        return names[self.searched(types) @ (1 << np.arange(len(MODALITIES)))]

    def without(self, *lost: Modality) -> "DetectedScene":
        """Return the scene without some modalities."""
        modality_detections = {
            name: found for name, found in self.modality_detections.items() if name not in lost
        }
        return replace(self, modality_detections=modality_detections)


def remaining_sets(
    modalities: Sequence[Modality], min_count: int
) -> Iterator[tuple[Modality, ...]]:
    """Yield what may remain of some modalities, down to a number of them, the most of them first.

    Example: of rgb, dm and rm down to 2: rgb dm rm; rgb dm; rgb rm; dm rm.
    """
    for count in range(len(modalities), min_count - 1, -1):
        yield from combinations(modalities, count)
