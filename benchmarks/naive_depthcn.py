"""Verification one candidate at a time, and suppression by loop: the oracle of the tests."""

import numpy as np

from perception.detection.verifier import Verifier
from perception.types import Float64, UInt8


def judge_one_by_one(
    verifier: Verifier, picture: UInt8, windows_px: Float64
) -> tuple[Float64, Float64]:
    """Return (M,) scores and (M, 4) boxes: a call of the network for each window."""
    judged = [verifier.judge(picture, window[None]) for window in windows_px]
    scores = [one.scores[0] for one in judged]
    boxes_px = [one.boxes_px[0] for one in judged]
    return np.asarray(scores, np.float64), np.asarray(boxes_px, np.float64).reshape(-1, 4)


def suppress_by_loop(boxes_px: Float64, scores: Float64, most_iou: float) -> list[int]:
    """Return the rows that stay, best first, comparing each with each that stays."""
    kept: list[int] = []
    for row in sorted(range(len(scores)), key=lambda row: -scores[row]):
        if all(_iou(boxes_px[row], boxes_px[other]) <= most_iou for other in kept):
            kept.append(row)
    return kept


def _iou(a: Float64, b: Float64) -> float:
    width = max(0.0, min(a[2], b[2]) - max(a[0], b[0]))
    height = max(0.0, min(a[3], b[3]) - max(a[1], b[1]))
    union = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - width * height
    return float(width * height / union) if union > 0 else 0.0
