"""Which labels a detector learns to find, and where it may say what it likes.

KITTI's measure looks for the objects of a class that are seen well enough, and passes over what is found of
alike types, of objects that are hard to see, and in DontCare regions. Training does the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.detection.detectors.input_size import InputSize
from perception.evaluation.detection.protocol import KITTI_CLASSES, Difficulty
from perception.types import Bool, Float32, Float64, Int, Labels

# KITTI's hard level, but for the height: what lies just below the limit of 25 pixels looks like what lies just
# above, and the far vehicles of a road are as low as this. Lower ones show too little to be learned from.
LEARNED = Difficulty("learned", min_height_px=16, max_occlusion=2, max_truncation=0.5)


@dataclass(frozen=True)
class DetectionTargets:
    """L boxes of one picture.

    Attributes:
        boxes_px: (L, 4) x1 y1 x2 y2 in pixels of the network's input, within it.
        classes: (L,) indices into the class names; 0 where none is meant.
        is_ignored: (L,) areas in which a detection is neither right nor wrong.
        min_height_px: lower objects show too little to be learned.
    """

    boxes_px: Float32
    classes: Int
    is_ignored: Bool
    min_height_px: float = 0.0

    def __len__(self) -> int:
        """Return L."""
        return len(self.boxes_px)

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the labels of a mask, of indices, or of a slice."""
        kept = self.boxes_px[rows], self.classes[rows], self.is_ignored[rows]
        return type(self)(*kept, self.min_height_px)


def detection_targets(
    labels: Labels, class_names: Sequence[str], size_px: tuple[int, int], size: InputSize
) -> DetectionTargets:
    """Return what is to be found in the picture of a frame, once it is stretched to the input.

    Args:
        labels: in pixels of the original; no box of it lies outside.
        class_names: what is looked for; compared without case. Alike types, such as Van for Car, are ignored
            unless they are looked for themselves.
        size_px: (width, height) of the original.
        size: of the input.
    """
    class_of = _class_numbers(class_names)
    numbers = np.array([class_of.get(str(name).lower(), -1) for name in labels.types], np.int64)
    is_target = np.isin(np.char.lower(labels.types.astype(np.str_)), _lower(class_names))
    rows = np.flatnonzero(numbers >= 0)
    regions = len(labels.dont_care_px)
    boxes_px = clipped(np.concatenate([labels.boxes_px[rows], labels.dont_care_px]), size_px)
    scale = np.tile([size.width_px / size_px[0], size.height_px / size_px[1]], 2)
    is_ignored = ~(is_target & _is_seen(labels))[rows]
    return DetectionTargets(
        boxes_px=(boxes_px * scale).astype(np.float32),
        classes=np.concatenate([numbers[rows], np.zeros(regions, np.int64)]),
        is_ignored=np.concatenate([is_ignored, np.ones(regions, bool)]),
        min_height_px=LEARNED.min_height_px * float(scale[1]),
    )


def labels_within_image(labels: Labels, size_px: tuple[int, int]) -> tuple[Labels, int]:
    """Return the labels without boxes and regions that cover nothing of a picture, and how many these are.

    Args:
        labels: of a frame.
        size_px: (width, height) of its picture.
    """
    is_kept = has_area(clipped(labels.boxes_px, size_px))
    is_region = has_area(clipped(labels.dont_care_px, size_px))
    kept = labels[is_kept]
    within = Labels(**{**vars(kept), "dont_care_px": labels.dont_care_px[is_region]})
    return within, int((~is_kept).sum() + (~is_region).sum())


def clipped(boxes_px: Float64, size_px: tuple[int, int]) -> Float64:
    """Return (M, 4) what of boxes lies in a picture of (width, height); of others a line or a point."""
    return np.clip(boxes_px, 0, np.tile(size_px, 2))


def has_area(boxes_px: np.ndarray) -> Bool:
    """Return (M,) whether (M, 4) boxes are of some width and height."""
    return np.asarray((boxes_px[:, 2:] > boxes_px[:, :2]).all(axis=1))


def _class_numbers(class_names: Sequence[str]) -> dict[str, int]:
    """Return the class of every type that is wanted, or like one that is wanted, in lower case."""
    numbers = {name: number for number, name in enumerate(_lower(class_names))}
    alike = {of_class.name.lower(): of_class.neighbours for of_class in KITTI_CLASSES}
    neighbours = {
        neighbour: number
        for name, number in numbers.items()
        for neighbour in _lower(alike.get(name, ()))
    }
    return {**neighbours, **numbers}


def _is_seen(labels: Labels) -> Bool:
    """Return (M,) who is seen well enough; tracking's truncation levels 1 and 2 are beyond the limit."""
    heights_px = labels.boxes_px[:, 3] - labels.boxes_px[:, 1]
    return np.asarray(
        (heights_px >= LEARNED.min_height_px)
        & (labels.occlusion <= LEARNED.max_occlusion)
        & (labels.truncation <= LEARNED.max_truncation)
    )


def _lower(names: Sequence[str]) -> list[str]:
    return [name.lower() for name in names]
