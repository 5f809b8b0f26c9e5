"""Training targets of the fusion: IoU of each box of a combination with the object (6.5), (6.6)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from data.detections.detected_frames import DetectedFrames
from perception.detection.config import TRI_BOX_CONFIGS, FusionVariant
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.features import tri_box_features
from perception.detection.fusion.tri_boxes import tri_boxes
from perception.errors import UsageError
from perception.evaluation.detection.box_rows import TrueBoxes
from perception.evaluation.detection.protocol import DONT_CARE, KITTI_CLASSES
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px
from perception.types import ArrayTable, Bool, Float32, Float64
from train.fusion.augmentation import DROPPED_MODALITIES, jitter_scores

_MIN_IGNORED_IOU = 0.5  # with a neighbouring type or DontCare region, above which a box is ignored


@dataclass(frozen=True)
class BoxTargets:
    """Truth of M boxes.

    Attributes:
        ious: (M,) largest IoU with a label of the same type, 0 without one.
        is_used: (M,) mask of the boxes outside DontCare regions and off neighbouring types, such as Van for Car.
    """

    ious: Float64
    is_used: Bool


@dataclass(frozen=True)
class FusionRows(ArrayTable):
    """T combinations of boxes.

    Attributes:
        features: (T, F) features of each combination.
        targets: (T, 3) IoU of each box with the object, 0 where there is no box.
        weights: (T, 3) weight of each target.
    """

    features: Annotated[Float32, ...]
    targets: Annotated[Float32, 3]
    weights: Annotated[Float32, 3]


@dataclass(frozen=True)
class FusionSets:
    """Combinations for training and for validation.

    Attributes:
        training: Rows to fit.
        validation: Rows that decide when to stop.
    """

    training: FusionRows
    validation: FusionRows


def box_targets(scene: DetectedScene, truth: TrueBoxes) -> BoxTargets:
    """Return the truth of all boxes of a scene, in the order of `DetectedScene.merged`."""
    found = scene.merged.detections
    types, true_types = _lower(found.types), _lower(truth.types)
    iou = iou_px(found.boxes_px, truth.boxes_px)
    ious = np.where(types[:, None] == true_types, iou, 0.0).max(axis=1, initial=0.0)
    alike = {one.name.lower(): [n.lower() for n in one.neighbours] for one in KITTI_CLASSES}
    is_alike = np.array([[t in alike.get(of, ()) for t in true_types] for of in types], bool)
    in_alike = np.where(is_alike.reshape(iou.shape), iou, 0.0).max(axis=1, initial=0.0)
    regions_px = truth.boxes_px[true_types == DONT_CARE]
    in_region = intersection_over_area_px(found.boxes_px, regions_px).max(axis=1, initial=0.0)
    return BoxTargets(
        ious,
        (ious > _MIN_IGNORED_IOU)
        | ((in_alike <= _MIN_IGNORED_IOU) & (in_region <= _MIN_IGNORED_IOU)),
    )


def fusion_rows(
    frames: DetectedFrames, variant: FusionVariant, score_jitters: int = 0
) -> FusionRows:
    """Return all combinations of all frames with their targets.

    The default variant also gets every frame without any one of the detectors, and all of these again with jittered
    scores. A missing box has no target; in the thesis' variants it has the target 0.

    Args:
        frames: Frames with labels.
        variant: Features of a combination.
        score_jitters: Number of copies with jittered scores, for the default variant.

    Raises:
        UsageError: there is no combination.
    """
    parts: list[FusionRows] = []
    if variant != "default":
        parts += _rows_of(frames, variant, 1.0)
    else:
        for version in (frames, *(jitter_scores(frames, seed) for seed in range(score_jitters))):
            parts += _rows_of(version, variant, 1.0)
            for missing in DROPPED_MODALITIES:
                parts += _rows_of(version.without(*missing), variant, 1 / len(DROPPED_MODALITIES))
    rows = FusionRows.concatenate(parts)
    if not len(rows):
        raise UsageError("fusion", expected="frames with detections", found="none")
    return rows


def _rows_of(frames: DetectedFrames, variant: FusionVariant, weight: float) -> Sequence[FusionRows]:
    return [
        _scene_rows(scene, frames.truth_of(number), variant, weight)
        for number, scene in enumerate(frames.scenes)
        if len(scene.merged.detections)
    ]


def _scene_rows(
    scene: DetectedScene, truth: TrueBoxes, variant: FusionVariant, weight: float
) -> FusionRows:
    rows = tri_boxes(scene, TRI_BOX_CONFIGS[variant])
    places = scene.merged.places(rows)
    is_observed = places >= 0
    targets = box_targets(scene, truth)
    is_counted = np.where(is_observed, targets.is_used[places], variant != "default")
    return FusionRows(
        tri_box_features(scene, rows, variant).astype(np.float32),
        np.where(is_observed, targets.ious[places], 0.0).astype(np.float32),
        (weight * is_counted).astype(np.float32),
    )


def _lower(types: np.ndarray) -> np.ndarray:
    return np.char.lower(types.astype(np.str_))
