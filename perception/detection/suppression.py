"""Several detections of one object: only the best stays (6.2.4)."""

import numpy as np

from perception.geometry.box_overlap_px import iou_px
from perception.types import Detections, Int


def suppress(detections: Detections, most_iou: float) -> Int:
    """Return the rows that stay, best first: none overlaps a better one of its class that stays.

    Going from best to worst, one asks of each whether a better one that stays overlaps it. Asking all at
    once, over and over, comes to the same answer: after n rounds the best n are settled, and mostly two
    or three rounds settle all.
    """
    order = np.argsort(-detections.scores, kind="stable")
    ranked = detections[order]
    is_same = ranked.types[:, None] == ranked.types
    is_beaten_by = np.triu((iou_px(ranked.boxes_px, ranked.boxes_px) > most_iou) & is_same, k=1)
    stays = np.ones(len(order), bool)
    while True:
        still = ~is_beaten_by[stays].any(axis=0)
        if np.array_equal(still, stays):
            return np.asarray(order[stays])
        stays = still
