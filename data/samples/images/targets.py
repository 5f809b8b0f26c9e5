"""Training targets of a detector: labelled boxes, and regions in which detections are ignored.

As KITTI's benchmark does, training ignores neighbouring types, objects that are hard to see, and DontCare regions.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.detection.detectors.network_input import ImagePlacement
from perception.evaluation.detection.protocol import KITTI_CLASSES, Difficulty
from perception.types import SHARED, ArrayTable, Bool, Float32, Float64, Int, Labels

# KITTI's hard level but for the minimum height: objects just below 25 pixels look like those just above, and far
# vehicles are that low. Lower ones show too little to be learned from.
TRAINING_DIFFICULTY = Difficulty("training", min_height_px=16, max_occlusion=2, max_truncation=0.5)


@dataclass(frozen=True)
class DetectionTargets(ArrayTable):
    """L boxes of one image.

    Attributes:
        boxes_px: (L, 4) x1 y1 x2 y2 in pixels of the network's input, within it.
        classes: (L,) indices into the class names; 0 of DontCare regions.
        is_ignored: (L,) mask of the boxes in which detections are neither right nor wrong.
        min_height_px: Minimum height of an object that is not ignored.
    """

    boxes_px: Annotated[Float32, 4]
    classes: Int
    is_ignored: Bool
    min_height_px: Annotated[float, SHARED] = 0.0


def detection_targets(
    labels: Labels, class_names: Sequence[str], placement: ImagePlacement
) -> DetectionTargets:
    """Return the targets of a frame's input image.

    Args:
        labels: Labels in pixels of the original image; no box lies outside.
        class_names: Classes to detect, in any case. Neighbouring types, such as Van for Car, are ignored
            unless they are among them.
        placement: Place of the image in the input.
    """
    class_of = _class_numbers(class_names)
    numbers = np.array([class_of.get(str(name).lower(), -1) for name in labels.types], np.int64)
    is_target = np.isin(np.char.lower(labels.types.astype(np.str_)), _lower(class_names))
    rows = np.flatnonzero(numbers >= 0)
    regions = len(labels.dont_care_px)
    all_px = np.concatenate([labels.boxes_px[rows], labels.dont_care_px])
    boxes_px = np.clip(all_px, *np.tile(np.reshape(placement.region, (2, 2)), 2))
    is_ignored = ~(is_target & _is_learnable(labels))[rows]
    targets = DetectionTargets(
        boxes_px=placement.to_input(boxes_px).astype(np.float32),
        classes=np.concatenate([numbers[rows], np.zeros(regions, np.int64)]),
        is_ignored=np.concatenate([is_ignored, np.ones(regions, bool)]),
        min_height_px=TRAINING_DIFFICULTY.min_height_px * placement.height_scale,
    )
    return targets[has_area(boxes_px)]


def labels_within_image(labels: Labels, size_px: tuple[int, int]) -> tuple[Labels, int]:
    """Return the labels without boxes and regions outside an image, and the number of these.

    Args:
        labels: Labels of a frame.
        size_px: (width, height) of its image.
    """
    is_kept = has_area(clip_boxes(labels.boxes_px, size_px))
    is_region = has_area(clip_boxes(labels.dont_care_px, size_px))
    kept = labels[is_kept]
    within = Labels(**{**vars(kept), "dont_care_px": labels.dont_care_px[is_region]})
    return within, int((~is_kept).sum() + (~is_region).sum())


def clip_boxes(boxes_px: Float64, size_px: tuple[int, int]) -> Float64:
    """Return (M, 4) boxes clipped to a (width, height) image; without area where they lie outside."""
    return np.clip(boxes_px, 0, np.tile(size_px, 2))


def has_area(boxes_px: np.ndarray) -> Bool:
    """Return the (M,) mask of the (M, 4) boxes with an area."""
    return np.asarray((boxes_px[:, 2:] > boxes_px[:, :2]).all(axis=1))


def _class_numbers(class_names: Sequence[str]) -> dict[str, int]:
    """Return the class index of each type that is a class or a neighbour of one, in lower case."""
    numbers = {name: number for number, name in enumerate(_lower(class_names))}
    alike = {of_class.name.lower(): of_class.neighbours for of_class in KITTI_CLASSES}
    neighbours = {
        neighbour: number
        for name, number in numbers.items()
        for neighbour in _lower(alike.get(name, ()))
    }
    return {**neighbours, **numbers}


def _is_learnable(labels: Labels) -> Bool:
    """Return the (M,) mask of the objects to learn; truncation levels 1 and 2 of tracking are too high."""
    heights_px = labels.boxes_px[:, 3] - labels.boxes_px[:, 1]
    return np.asarray(
        (heights_px >= TRAINING_DIFFICULTY.min_height_px)
        & (labels.occlusion <= TRAINING_DIFFICULTY.max_occlusion)
        & (labels.truncation <= TRAINING_DIFFICULTY.max_truncation)
    )


def _lower(names: Sequence[str]) -> list[str]:
    return [name.lower() for name in names]
