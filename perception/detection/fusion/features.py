"""Features of a combination of boxes, the input of the fusion network (6.4).

The thesis' 23 features, with C = rgb, D = dm, R = rm:

    0..2    sC sD sR                        scores
    3..14   wC hC xC yC  wD hD xD yD  ...   size and centre, in shares of the image
    15..18  μx μy σx σy                     mean and deviation of the centres of the existing boxes
    19..22  w h x y                         smallest box around them

A missing box has zeros. The default features are the scores, flags of the modalities whose detector ran and knows the
class, and a flag for each class; positions in the image do not transfer from one road to another.
"""

from collections.abc import Mapping

import numpy as np

from perception.detection.config import FusionVariant
from perception.detection.fusion.detected_scene import DetectedScene
from perception.types import MODALITIES, Float64, Int

# Road users; those of other classes have no flag.
CLASSES = ("Car", "Van", "Truck", "Pedestrian", "Cyclist")
_SCORES = tuple(f"score_{name}" for name in MODALITIES)

_PLACES = ("width", "height", "x", "y")
_PLACED = (
    *(f"{part}_{name}" for name in MODALITIES for part in _PLACES),
    *("mean_x", "mean_y", "deviation_x", "deviation_y"),
    *(f"{part}_around" for part in _PLACES),
)
FEATURES: Mapping[FusionVariant, tuple[str, ...]] = {
    "scores": _SCORES,
    "features": (*_SCORES, *_PLACED),
    "default": (
        *_SCORES,
        *(f"searched_{name}" for name in MODALITIES),
        *(f"is_{name.lower()}" for name in CLASSES),
    ),
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
    types = found.types[places.max(axis=0)]  # that of any box, as -1 is none
    return np.vstack([scores, scene.searched(types).T, *(types == name for name in CLASSES)]).T


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
