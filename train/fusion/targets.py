"""Training rows of the fusion: features and targets of combinations.

In the thesis' variants the target of a box is its IoU with the object (6.5), (6.6). Average precision asks whether the
IoU exceeds a threshold, so that the default learns the share of KITTI's thresholds that are exceeded.

The default also learns from frames without one of the detectors, and from jittered scores: on roads that they were not
trained on, the scores of detectors are miscalibrated by different amounts. Trained on jittered scores, the fusion
relies more on agreement and on the depth of the boxes.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from data.detections.detected_frames import DetectedFrames
from perception.detection.config import FusionVariant, TriBoxConfig, tri_box_config
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.features import tri_box_features
from perception.detection.fusion.rescoring import is_rescored
from perception.detection.fusion.score_calibration import BetaCalibration
from perception.detection.fusion.tri_boxes import tri_boxes
from perception.errors import UsageError
from perception.evaluation.detection.box_rows import TrueBoxes
from perception.evaluation.detection.protocol import DONT_CARE, KITTI_CLASSES
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px
from perception.types import ArrayTable, Bool, Float32, Float64, Modality

_MIN_IGNORED_IOU = 0.5  # with a neighbouring type or DontCare region, above which a box is ignored
_KITTI_IOUS = tuple(sorted({one.iou for one in KITTI_CLASSES}))
_MAX_ROWS = 20_000_000  # 8 GB in double precision
# Modalities that are dropped; with a single one left there is nothing to fuse.
DROPPED_MODALITIES: tuple[tuple[Modality, ...], ...] = (("rgb",), ("dm",), ("rm",))
# Largest stretch of the scores' logits, and standard deviation of their shift, for each frame and modality.
_MAX_STRETCH, _SHIFT = 0.15, 0.9


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
        targets: (T, 3) IoU of each box with the object, 0 where there is no box; of the default variant the share of
            KITTI's thresholds that this IoU exceeds.
        weights: (T, 3) weight of each target.
    """

    features: Annotated[Float32, ...]
    targets: Annotated[Float32, ...]
    weights: Annotated[Float32, ...]


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
    is_outside = in_region <= _MIN_IGNORED_IOU
    return BoxTargets(
        ious, (ious > _MIN_IGNORED_IOU) | ((in_alike <= _MIN_IGNORED_IOU) & is_outside)
    )


def fusion_rows(
    frames: DetectedFrames,
    variant: FusionVariant,
    max_partners: int | None = None,
    score_jitters: int = 0,
) -> FusionRows:
    """Return all combinations of all frames with their targets.

    The default variant also gets every frame without any one of the detectors, and all of these again with jittered
    scores. A missing box has no target; in the thesis' variants it has the target 0.

    Args:
        frames: Frames with labels.
        variant: Features of a combination.
        max_partners: Maximum number of boxes of each other modality that a box is combined with, 0 for all; else
            that of the variant.
        score_jitters: Number of copies with jittered scores, for the default variant.

    Raises:
        UsageError: there is no combination, or there are more than a computer's memory holds.
    """
    weighted = [(frames, 1.0)]
    if variant == "default":
        versions = (frames, *(jitter_scores(frames, seed) for seed in range(score_jitters)))
        share = 1 / len(DROPPED_MODALITIES)
        weighted = [
            one
            for whole in versions
            for one in (
                (whole, 1.0),
                *((whole.without(*missing), share) for missing in DROPPED_MODALITIES),
            )
        ]
    config = tri_box_config(variant, max_partners)
    rows, count = [], 0
    for part, weight in weighted:
        for one in _rows_of(part, variant, config, weight):
            rows.append(one)
            count += len(one)
            if count > _MAX_ROWS:
                raise UsageError(
                    "fusion",
                    expected=f"at most {_MAX_ROWS:,} combinations",
                    found="more",
                    advice="combine fewer boxes by --model.max_partners, or take fewer frames",
                )
    if not count:
        raise UsageError("fusion", expected="frames with detections", found="none")
    return FusionRows.concatenate(rows)


def jitter_scores(frames: DetectedFrames, seed: int) -> DetectedFrames:
    """Return the same boxes with scores that other detectors might have given them, in the same order."""
    rng = np.random.default_rng(seed)
    return replace(frames, scenes=tuple(_jitter_scene(scene, rng) for scene in frames.scenes))


def _jitter_scene(scene: DetectedScene, rng: np.random.Generator) -> DetectedScene:
    modality_detections = {}
    for name, found in scene.modality_detections.items():
        stretch = 1 + _MAX_STRETCH * rng.uniform(-1, 1)
        other = BetaCalibration(stretch, stretch, _SHIFT * rng.standard_normal())
        modality_detections[name] = replace(found, scores=other.probabilities(found.scores))
    return replace(scene, modality_detections=modality_detections)


def _rows_of(
    frames: DetectedFrames, variant: FusionVariant, config: TriBoxConfig, weight: float
) -> Iterator[FusionRows]:
    for number, scene in enumerate(frames.scenes):
        if len(scene.merged.detections):
            yield _scene_rows(scene, frames.truth_of(number), variant, config, weight)


def _scene_rows(
    scene: DetectedScene,
    truth: TrueBoxes,
    variant: FusionVariant,
    config: TriBoxConfig,
    weight: float,
) -> FusionRows:
    rows = tri_boxes(scene, config)
    places = scene.merged.places(rows)
    is_learned = is_rescored(scene, scene.merged.detections.types, variant)[places.max(axis=1)]
    rows, places = rows[is_learned], places[is_learned]
    is_observed = places >= 0
    found = box_targets(scene, truth)
    ious = np.where(is_observed, found.ious[places], 0.0)
    targets, weights = ious, ~is_observed | found.is_used[places]
    if variant == "default":
        targets = np.mean([ious > threshold for threshold in _KITTI_IOUS], axis=0)
        weights = is_observed & found.is_used[places]
    return FusionRows(
        tri_box_features(scene, rows, variant).astype(np.float32),
        targets.astype(np.float32),
        (weight * weights).astype(np.float32),
    )


def _lower(types: np.ndarray) -> np.ndarray:
    return np.char.lower(types.astype(np.str_))
