"""Combinations of boxes of the three modalities that may show the same object: tri-boxes (6.2.4, Fig. 6.7).

Example: rgb 0 overlaps dm 0 and dm 1, and no box of the reflectance map; rm 0 overlaps none:

    rgb  dm  rm
      0   0  -1
      0   1  -1
     -1  -1   0
"""

import numpy as np

from perception.detection.config import TRI_BOX_CONFIGS, TriBoxConfig
from perception.detection.fusion.detected_scene import DetectedScene
from perception.types import MODALITIES, Bool, Float64, Int


def tri_boxes(scene: DetectedScene, config: TriBoxConfig = TRI_BOX_CONFIGS["features"]) -> Int:
    """Return the (T, 3) rows in the detections of each of `MODALITIES`, -1 where a modality has no box.

    Each of the M boxes is in at least one combination, and in at most K² for at most K partners.

    Args:
        scene: Detections of one frame.
        config: Combination parameters.
    """
    merged = scene.merged
    if not len(merged.detections):
        return np.zeros((0, len(MODALITIES)), np.int64)
    is_same = (merged.iou > config.min_iou) & merged.is_same_class
    if config.by_set:
        is_same = _in_one_set(is_same)
    partners, counts = _partners(scene, np.where(is_same, merged.iou, -1.0), config.max_partners)
    # Every choice of one partner in each modality, for every box: the digits of one number for each choice.
    choices = counts.prod(axis=1)
    box = np.repeat(np.arange(len(counts)), choices)
    left = np.arange(len(box)) - np.repeat(np.cumsum(choices) - choices, choices)
    rows = np.empty((len(box), len(MODALITIES)), np.int64)
    for column in range(len(MODALITIES)):
        left, digit = np.divmod(left, counts[box, column])
        rows[:, column] = partners[box, column, digit]
    # One number for each row removes duplicates, which the boxes of a row produce.
    sizes = tuple(np.bincount(merged.columns, minlength=len(MODALITIES)) + 1)
    codes = np.unique(np.ravel_multi_index(tuple(rows.T + 1), sizes))
    return np.stack(np.unravel_index(codes, sizes), axis=1) - 1


def _in_one_set(is_same: Bool) -> Bool:
    """Return the (M, M) mask of connected boxes, by paths that double in length in each round."""
    while True:
        links = is_same.astype(np.float32)
        is_connected = links @ links > 0
        if np.array_equal(is_connected, is_same):
            return np.asarray(is_same)
        is_same = is_connected


def _partners(scene: DetectedScene, overlap: Float64, max_partners: int) -> tuple[Int, Int]:
    """Return the (M, 3, K) rows of the best partners of each box, and the (M, 3) number of them.

    A box is its own partner; where a modality has no partner, the only entry is -1.

    Args:
        scene: Detections of one frame, M boxes.
        overlap: (M, M) overlap of two boxes, below 0 where they cannot show the same object.
        max_partners: Maximum number of partners in each modality; 0 for all.
    """
    merged = scene.merged
    box_count = len(merged.columns)
    most = max_partners or int(np.bincount(merged.columns).max())
    partners = np.full((box_count, len(MODALITIES), most), -1)
    counts = np.ones((box_count, len(MODALITIES)), np.int64)
    by_score = np.argsort(-merged.detections.scores, kind="stable")  # order of equal overlaps
    for column in range(len(MODALITIES)):
        others = by_score[merged.columns[by_score] == column]
        best = others[_largest(overlap[:, others], most)]
        is_partner = np.take_along_axis(overlap, best, axis=1) >= 0
        rows = np.where(is_partner, best - merged.starts[column], -1)
        partners[:, column, : rows.shape[1]] = rows
        counts[:, column] = np.maximum(is_partner.sum(axis=1), 1)
    own = np.arange(box_count)
    partners[own, merged.columns, 0] = own - merged.starts[merged.columns]
    counts[own, merged.columns] = 1
    return partners, counts


def _largest(values: Float64, count: int) -> Int:
    """Return the (M, count) columns of the largest of (M, N) values, the first of equals first; all of fewer."""
    if count == 1 and values.shape[1]:
        # A tenth of the time of sorting them all.
        return np.asarray(values.argmax(axis=1)[:, None])
    return np.argsort(-values, axis=1, kind="stable")[:, :count]
