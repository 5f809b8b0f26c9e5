"""Which boxes of the three modalities may show the same object: tri-boxes (6.2.4, Fig. 6.7).

rgb 0 overlaps dm 0 and dm 1; no box of the reflectance map is near; rm 0 is alone:

    rgb  dm  rm
      0   0  -1
      0   1  -1
     -1  -1   0
"""

import numpy as np

from perception.detection.config import TRI_BOX_CONFIGS, TriBoxConfig
from perception.detection.fusion.detected_scene import DetectedScene
from perception.geometry.box_overlap_px import iou_px
from perception.types import MODALITIES, Bool, Float64, Int


def tri_boxes(scene: DetectedScene, config: TriBoxConfig = TRI_BOX_CONFIGS["features"]) -> Int:
    """Return (T, 3) rows in the detections of each of `MODALITIES`, -1 where a modality has no box there.

    Each of the M boxes is in at least one combination. There are at most K² for each, of K partners.
    """
    merged = scene.merged
    if not len(merged.detections):
        return np.zeros((0, len(MODALITIES)), np.int64)
    boxes_px, types = merged.detections.boxes_px, merged.detections.types
    iou = iou_px(boxes_px, boxes_px)
    is_same = (iou > config.min_iou) & (types[:, None] == types)
    if config.by_set:
        is_same = _in_one_set(is_same)
    partners, is_taken = _partners(scene, np.where(is_same, iou, -1.0), config.max_partners)
    # Every choice of one of the K of each modality, for every box: (M, K, K, K).
    first, second, third = (partners[:, column] for column in range(len(MODALITIES)))
    is_row: Bool = (
        is_taken[:, 0, :, None, None] & is_taken[:, 1, None, :, None] & is_taken[:, 2, None, None]
    )
    # One number a row, so that what several boxes of a row ask for is there once.
    sizes = np.bincount(merged.columns, minlength=len(MODALITIES)) + 1
    codes = ((first[:, :, None, None] + 1) * sizes[1] + second[:, None, :, None] + 1) * sizes[2] + (
        third[:, None, None] + 1
    )
    return np.stack(np.unravel_index(np.unique(codes[is_row]), tuple(sizes)), axis=1) - 1


def _in_one_set(is_same: Bool) -> Bool:
    """Return (M, M) which boxes are connected by others, twice as far at every round."""
    while True:
        links = is_same.astype(np.float32)
        is_connected = links @ links > 0
        if np.array_equal(is_connected, is_same):
            return np.asarray(is_same)
        is_same = is_connected


def _partners(scene: DetectedScene, worth: Float64, most: int) -> tuple[Int, Bool]:
    """Return (M, 3, K) rows of the best partners of each box, and which of these places are taken.

    A box is its own partner; where there is no other, the first place is taken by -1.

    Args:
        scene: with M boxes.
        worth: (M, M) of one box to another, below 0 where they have nothing in common.
        most: K.
    """
    merged = scene.merged
    count = len(merged.columns)
    partners = np.full((count, len(MODALITIES), most), -1)
    is_taken = np.zeros(partners.shape, bool)
    is_taken[:, :, 0] = True
    by_score = np.argsort(-merged.detections.scores, kind="stable")  # decides between equals
    for column in range(len(MODALITIES)):
        others = by_score[merged.columns[by_score] == column]
        order = np.argsort(-worth[:, others], axis=1, kind="stable")[:, :most]
        best = others[order]
        is_partner = np.take_along_axis(worth, best, axis=1) >= 0
        rows = np.where(is_partner, best - merged.starts[column], -1)
        partners[:, column, : rows.shape[1]] = rows
        is_taken[:, column, 1 : rows.shape[1]] = is_partner[:, 1:]
    own = np.arange(count)
    partners[own, merged.columns, 0] = own - merged.starts[merged.columns]
    is_taken[own, merged.columns, 1:] = False
    return partners, is_taken
