"""Features of a combination of boxes, the input of the fusion network (6.4).

The thesis' 23 features, with C = rgb, D = dm, R = rm:

    0..2    sC sD sR                        scores
    3..14   wC hC xC yC  wD hD xD yD  ...   size and centre, in shares of the image
    15..18  μx μy σx σy                     mean and deviation of the centres of the existing boxes
    19..22  w h x y                         smallest box around them

A missing box has zeros. The default features do not contain positions in the image, which do not transfer from one
road to another. They hold the scores as log-odds, sums of which are what independent detectors know together, and
depths, metric heights of the boxes (the same for cameras of every field of view), overlaps, flags of missing boxes and
detectors, the class, and the best score of any other class at the same place in each modality.
"""

from collections.abc import Mapping

import numpy as np

from perception.detection.config import FusionVariant
from perception.detection.fusion.detected_scene import DetectedScene
from perception.geometry.box_overlap_px import paired_iou_px
from perception.types import MODALITIES, Float64, Int

_PAIRS = ((0, 1), (0, 2), (1, 2))
# Road users; those of other classes have no flag.
CLASSES = ("Car", "Van", "Truck", "Pedestrian", "Cyclist")
_SAME_PLACE_IOU = 0.5  # above which boxes of two classes are at one place
_SCORES = tuple(f"score_{name}" for name in MODALITIES)
_LOG_ODDS = tuple(f"log_odds_{name}" for name in MODALITIES)
_MIN_SCORE = 0.005  # of log-odds, and of a missing box; no detector reports boxes of less


_PLACES = ("width", "height", "x", "y")
_PLACED = (
    *(f"{part}_{name}" for name in MODALITIES for part in _PLACES),
    *("mean_x", "mean_y", "deviation_x", "deviation_y"),
    *(f"{part}_around" for part in _PLACES),
)
_ADDED = (
    *(f"{part}_{name}" for part in ("near", "middle", "height_m", "aspect") for name in MODALITIES),
    *(f"iou_{MODALITIES[a]}_{MODALITIES[b]}" for a, b in _PAIRS),
    *(f"{what}_{name}" for what in ("seen", "looked") for name in MODALITIES),
    "has_depth",
    *(f"is_{name.lower()}" for name in CLASSES),
    *(f"other_class_{name}" for name in MODALITIES),
)
FEATURES: Mapping[FusionVariant, tuple[str, ...]] = {
    "scores": _SCORES,
    "features": (*_SCORES, *_PLACED),
    "default": (*_LOG_ODDS, *_ADDED),
}


def tri_box_features(scene: DetectedScene, tri_boxes: Int, variant: FusionVariant) -> Float64:
    """Return the (T, F) features of (T, 3) combinations, in the order of `FEATURES`."""
    found = scene.merged.detections
    # (F, T) until the end: numpy is fast along the long axis. A missing box has index -1, the last row of each
    # table below.
    places = scene.merged.places(tri_boxes).T.copy()
    scores: Float64 = np.append(found.scores, 0.0)[places]
    if variant == "scores":
        return scores.T
    if variant == "features":
        return np.vstack([scores, *_layout(found.boxes_px / np.tile(scene.size_px, 2), places)]).T
    return np.vstack([score_features(scores, variant), *_added(scene, places)]).T


def score_features(scores: Float64, variant: FusionVariant) -> Float64:
    """Return the features of scores, 0 of missing boxes, in any shape."""
    if variant != "default":
        return scores
    within = np.clip(scores, _MIN_SCORE, 1 - _MIN_SCORE)
    return np.asarray(np.log(within / (1 - within)))


def _layout(boxes: Float64, places: Int) -> list[Float64]:
    """Return the features after the scores, from (M, 4) boxes in shares of the image and their (3, T) indices."""
    is_observed = places >= 0
    shapes = np.hstack([_size_and_center(boxes.T), np.zeros((4, 1))])[:, places]
    centers, counts = shapes[2:], np.maximum(is_observed.sum(axis=0), 1)
    mean = centers.sum(axis=1) / counts
    # Population deviation: 0 for one box, not unknown.
    squares = np.where(is_observed, (centers - mean[:, None]) ** 2, 0.0).sum(axis=1)
    edges = np.vstack([boxes, [np.inf, np.inf, -np.inf, -np.inf]]).T[:, places]
    around = _size_and_center(np.vstack([edges[:2].min(axis=1), edges[2:].max(axis=1)]))
    return [
        shapes.swapaxes(0, 1).reshape(4 * len(MODALITIES), -1),
        mean,
        np.sqrt(squares / counts),
        around,
    ]


def _size_and_center(edges: Float64) -> Float64:
    """Return the (4, N) width, height and centre of (4, N) edges x1 y1 x2 y2."""
    first, last = edges[:2], edges[2:]
    return np.concatenate([last - first, (first + last) / 2])


def _added(scene: DetectedScene, places: Int) -> list[Float64]:
    """Return the default's added features; in logarithms, since depths differ by factors."""
    boxes_px, is_observed = scene.merged.detections.boxes_px, places >= 0
    depths_m = scene.merged_depths_m
    size_px = np.maximum(boxes_px[:, 2:] - boxes_px[:, :2], 1.0)
    # Metric height of the box at its depth, which separates cars from higher and lower objects.
    heights_m = depths_m[:, 1] * size_px[:, 1] / scene.focal_px
    known = np.nan_to_num(np.log1p([*depths_m.T, heights_m]))
    of_boxes = np.vstack([known, np.log(size_px[:, 0] / size_px[:, 1])])
    each = np.hstack([of_boxes, np.zeros((4, 1))])[:, places].reshape(4 * len(MODALITIES), -1)
    # A missing box has no area, and so no overlap.
    corners_px = np.vstack([boxes_px, np.zeros(4)])[places]
    overlaps = [paired_iou_px(corners_px[a], corners_px[b]) for a, b in _PAIRS]
    types = scene.merged.detections.types[places.max(axis=0)]  # that of any box, as -1 is none
    looked = scene.searched(types).T * 1.0
    has_depth = np.full((1, len(types)), float(bool(scene.depths_m)))
    flags = np.stack([types == name for name in CLASSES]) * 1.0
    others = np.hstack([_other_class_scores(scene).T, np.zeros((len(MODALITIES), 1))])
    other_classes = others[:, places].max(axis=1)
    return [each, np.stack(overlaps), is_observed * 1.0, looked, has_depth, flags, other_classes]


def _other_class_scores(scene: DetectedScene) -> Float64:
    """Return the (M, 3) best score of any other class at the place of each box, by modality."""
    merged = scene.merged
    is_other = ~merged.is_same_class & (merged.iou > _SAME_PLACE_IOU)
    ones, others = np.nonzero(is_other)
    best = np.zeros((len(is_other), len(MODALITIES)))
    np.maximum.at(best, (ones, merged.columns[others]), merged.detections.scores[others])
    return best
