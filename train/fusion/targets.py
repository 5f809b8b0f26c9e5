"""Training rows of the fusion: features and targets of combinations.

In the thesis' variants the target of a box is its IoU with the object (6.5), (6.6). Average precision asks whether the
IoU exceeds a threshold, so that the default learns the share of thresholds that its blended box exceeds. It also
learns from corrupted copies of its frames: on roads that they were not trained on, the scores of detectors are
miscalibrated by different amounts, and the maps' detectors find other things than on synthetic streets. Every set of
modalities that may remain where some are absent is learned from all frames.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from data.detections.detected_frames import DetectedFrames
from perception.detection.config import FusionVariant, TriBoxConfig, tri_box_config
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.features import tri_box_features
from perception.detection.fusion.matched_boxes import blended_boxes_px, matched_boxes
from perception.detection.fusion.rescoring import is_rescored
from perception.detection.fusion.score_calibration import BetaCalibration
from perception.detection.fusion.tri_boxes import tri_boxes
from perception.errors import UsageError
from perception.evaluation.detection.box_rows import TrueBoxes
from perception.evaluation.detection.protocol import DONT_CARE, KITTI_CLASSES
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px
from perception.types import (
    MODALITIES,
    ArrayTable,
    Bool,
    Detections,
    Float32,
    Float64,
    Modality,
)

_MIN_IGNORED_IOU = 0.5  # with a neighbouring type or DontCare region, above which a box is ignored
# What a default score is the mean of: beside KITTI's, an overlap that a box of another object seldom has. Without it, the
# maps' boxes of cars that the camera hardly shows count for little, as they fit less well.
_TARGET_IOUS = (0.3, *sorted({one.iou for one in KITTI_CLASSES}))
_MAX_ROWS = 20_000_000  # 8 GB in double precision
# Largest stretch of the scores' logits, and standard deviation of their shift, for each frame and modality.
_MAX_STRETCH, _SHIFT = 0.15, 0.9
# Share of the corrupted frames in which a modality has the boxes of another frame: what it finds, and what it misses, is
# no evidence there. Maps of reflectance differ most from road to road, images of the camera least. The first of the
# modalities that are searched is never taken for wrong.
_MISMATCHES: Mapping[Modality, float] = {"rgb": 0.0, "dm": 0.3, "rm": 0.6}


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
            thresholds (0.3, 0.5, 0.7) that the IoU of the blended box exceeds.
        weights: (T, 3) weight of each target.
    """

    features: Annotated[Float32, ...]
    targets: Annotated[Float32, ...]
    weights: Annotated[Float32, ...]


def box_targets(found: Detections, truth: TrueBoxes) -> BoxTargets:
    """Return the truth of detections."""
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
    corrupted_copies: int = 0,
) -> FusionRows:
    """Return all combinations of all frames with their targets.

    In the thesis' variants a missing box has the target 0; in the default all boxes of a combination have that of their
    blended box, and all frames come again without each of the modalities, as long as two remain.

    Args:
        frames: Frames with labels.
        variant: Features of a combination.
        max_partners: Maximum number of boxes of each other modality that a box is combined with, 0 for all; else
            that of the variant.
        corrupted_copies: Number of copies with corrupted detections, for the default variant.

    Raises:
        UsageError: there is no combination, or there are more than a computer's memory holds.
    """
    config = tri_box_config(variant, max_partners)
    scenes = list(frames.scenes)
    if variant == "default":
        learned = list(_learned_frames(frames, corrupted_copies))
        scenes = [scene for one in learned for scene in one.scenes]
    rows, count = [], 0
    for number, scene in enumerate(scenes):
        if not len(scene.merged.detections):
            continue
        truth = frames.truth_of(number % len(frames))
        if variant == "default":
            rows.append(_blended_rows(scene, truth, config.min_iou))
        else:
            rows.append(_separate_rows(scene, truth, variant, config))
        count += len(rows[-1])
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


def _learned_frames(frames: DetectedFrames, corrupted_copies: int) -> Iterator[DetectedFrames]:
    """Yield the frames with every set of modalities that may remain, as they are and corrupted."""
    for remaining in frames.remaining():
        yield remaining
        # With all three, learning from mismatches gains a little precision and costs tracks: those of sequence 0000
        # had a HOTA of 69 in place of 71.
        is_whole = len(remaining.modalities) == len(MODALITIES)
        for seed in range(corrupted_copies):
            copy = remaining if is_whole else mismatch_views(remaining, seed)
            yield jitter_scores(copy, seed)


def mismatch_views(frames: DetectedFrames, seed: int) -> DetectedFrames:
    """Return the frames, some with the detections of a modality in another frame."""
    rng = np.random.default_rng(seed)
    scenes = []
    for scene in frames.scenes:
        _, *others = (name for name in MODALITIES if name in scene.modality_detections)
        mismatched = {
            name: frames.scenes[rng.integers(len(frames))].modality_detections.get(
                name, Detections.empty()
            )
            for name in others
            if rng.random() < _MISMATCHES[name]
        }
        found = {**scene.modality_detections, **mismatched}
        scenes.append(replace(scene, modality_detections=found))
    return replace(frames, scenes=tuple(scenes))


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


def _separate_rows(
    scene: DetectedScene, truth: TrueBoxes, variant: FusionVariant, config: TriBoxConfig
) -> FusionRows:
    rows = tri_boxes(scene, config)
    places = scene.merged.places(rows)
    is_learned = is_rescored(scene, scene.merged.detections.types, variant)[places.max(axis=1)]
    rows, places = rows[is_learned], places[is_learned]
    is_observed = places >= 0
    found = box_targets(scene.merged.detections, truth)
    return FusionRows(
        tri_box_features(scene, rows, variant).astype(np.float32),
        np.where(is_observed, found.ious[places], 0.0).astype(np.float32),
        (~is_observed | found.is_used[places]).astype(np.float32),
    )


def _blended_rows(scene: DetectedScene, truth: TrueBoxes, min_iou: float) -> FusionRows:
    rows = matched_boxes(scene, min_iou)
    types = scene.merged.detections.types[scene.merged.places(rows).max(axis=1)]
    is_learned = is_rescored(scene, types, "default")
    rows, types = rows[is_learned], types[is_learned]
    boxes = Detections(blended_boxes_px(scene, rows), np.ones(len(rows)), types)
    found = box_targets(boxes, truth)
    targets = np.mean([found.ious > threshold for threshold in _TARGET_IOUS], axis=0)
    is_observed = rows >= 0
    weights = is_observed * (found.is_used / is_observed.sum(axis=1))[:, None]
    return FusionRows(
        tri_box_features(scene, rows, "default").astype(np.float32),
        np.repeat(targets[:, None], rows.shape[1], axis=1).astype(np.float32),
        weights.astype(np.float32),
    )


def _lower(types: np.ndarray) -> np.ndarray:
    return np.char.lower(types.astype(np.str_))
