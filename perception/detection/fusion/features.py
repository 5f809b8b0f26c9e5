"""What the network of the fusion is told of each combination of boxes (6.4).

23 numbers as printed, C = rgb, D = dm, R = rm:

    0..2    sC sD sR                        scores
    3..14   wC hC xC yC  wD hD xD yD  ...   size and centre, in shares of the picture
    15..18  μx μy σx σy                     mean and deviation of the centres of the boxes that are there
    19..22  w h x y                         of the smallest box around them

A box that is not there has zeros. The richer set goes on with distances, overlaps, and what is missing.
"""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from perception.detection.fusion.detected_scene import DetectedScene
from perception.geometry.box_overlap_px import paired_iou_px
from perception.types import MODALITIES, Bool, Float64, Int

# By what a combination is judged: its scores, the thesis' 23 features, or all that we can say.
Variant = Literal["scores", "features", "default"]

_PAIRS = ((0, 1), (0, 2), (1, 2))
_BOX = ("width", "height", "x", "y")
_SCORES = tuple(f"score_{name}" for name in MODALITIES)
_PRINTED = (
    *_SCORES,
    *(f"{part}_{name}" for name in MODALITIES for part in _BOX),
    *("mean_x", "mean_y", "deviation_x", "deviation_y"),
    *(f"{part}_around" for part in _BOX),
)
_ADDED = (
    *(f"{part}_{name}" for part in ("near", "middle", "size", "aspect") for name in MODALITIES),
    *(f"iou_{MODALITIES[a]}_{MODALITIES[b]}" for a, b in _PAIRS),
    *(f"{what}_{name}" for what in ("seen", "looked") for name in MODALITIES),
    "has_depth",
)
FEATURES: Mapping[Variant, tuple[str, ...]] = {
    "scores": _SCORES,
    "features": _PRINTED,
    "default": (*_PRINTED, *_ADDED),
}


def tri_box_features(scene: DetectedScene, tri_boxes: Int, variant: Variant) -> Float64:
    """Return (T, F) the features of (T, 3) combinations, in the order of `FEATURES`."""
    places = scene.merged.places(tri_boxes)
    is_seen = places >= 0
    scores = np.where(is_seen, _taken(scene.merged.detections.scores, places), 0.0)
    if variant == "scores":
        return scores
    boxes_px = _taken(scene.merged.detections.boxes_px, places)
    shares = boxes_px / np.tile(scene.size_px, 2)
    printed = [scores, *_printed(shares, is_seen)]
    if variant == "features":
        return np.hstack(printed)
    depths_m = _taken(scene.merged_depths_m, places)
    return np.hstack([*printed, *_added(scene, boxes_px, depths_m, is_seen)])


def _taken(values: Float64, places: Int) -> Float64:
    """Return (T, 3, ...) values at places; any value where the place is -1."""
    if not len(values):
        return np.zeros((*places.shape, *values.shape[1:]))
    return np.asarray(values[places])


def _printed(shares: Float64, is_seen: Bool) -> list[Float64]:
    """Return the columns after the scores, of (T, 3, 4) boxes in shares of the picture."""
    seen = is_seen[..., None]
    boxes = np.where(seen, _size_and_center(shares), 0.0)
    centers = boxes[..., 2:]
    counts = np.maximum(is_seen.sum(axis=1), 1)[:, None]
    mean = centers.sum(axis=1) / counts
    # Of the population: of one box it is 0, not unknown.
    squares = np.where(seen, (centers - mean[:, None]) ** 2, 0.0).sum(axis=1)
    first = np.where(seen, shares[..., :2], np.inf).min(axis=1)
    last = np.where(seen, shares[..., 2:], -np.inf).max(axis=1)
    around = _size_and_center(np.hstack([first, last]))
    return [boxes.reshape(len(boxes), 4 * len(MODALITIES)), mean, np.sqrt(squares / counts), around]


def _size_and_center(boxes: Float64) -> Float64:
    """Return (..., 4) width, height and centre of (..., 4) boxes x1 y1 x2 y2."""
    first, last = boxes[..., :2], boxes[..., 2:]
    return np.concatenate([last - first, (first + last) / 2], axis=-1)


def _added(
    scene: DetectedScene, boxes_px: Float64, depths_m: Float64, is_seen: Bool
) -> list[Float64]:
    """Return the columns beyond the printed ones; logarithms, as near and far differ by factors."""
    size_px = np.maximum(boxes_px[..., 2:] - boxes_px[..., :2], 1.0)
    # How high it is at its distance, in units of the picture's height: what is no car is too high or low.
    height = depths_m[..., 1:] * (size_px[..., 1:] / scene.size_px[1])
    aspect = np.where(is_seen, np.log(size_px[..., 0] / size_px[..., 1]), 0.0)
    logs = np.log1p(np.concatenate([depths_m, height], axis=-1))
    known = np.where(is_seen[..., None], np.nan_to_num(logs), 0.0)
    overlaps = [
        np.where(is_seen[:, a] & is_seen[:, b], paired_iou_px(boxes_px[:, a], boxes_px[:, b]), 0.0)
        for a, b in _PAIRS
    ]
    looked = [float(name in scene.modal) for name in MODALITIES]
    of_frame = np.tile([*looked, float(bool(scene.depths_m))], (len(boxes_px), 1))
    near, middle, size = (known[..., part] for part in range(3))
    return [near, middle, size, aspect, np.stack(overlaps, axis=1), is_seen * 1.0, of_frame]
