"""Average precision of boxes that are matched by the distance of their centres on the ground.

Caesar et al., "nuScenes", CVPR 2020, 3.1: a detection is right where a label that no better one has matched is within a
distance; precision is averaged over recalls above 0.1, less 0.1. Objects that are ignored are neither right nor wrong.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from perception.types import Bool, Float64

_RECALLS = np.linspace(0, 1, 101)
_LOW = 0.1  # of recall and precision, below which neither counts


@dataclass(frozen=True)
class CenterFrame:
    """Objects of one class in one frame.

    Attributes:
        centers_m: (M, 2) centres of the labels.
        is_ignored: (M,) labels that need not be found.
        found_m: (D, 2) centres of the detections.
        scores: (D,) their scores.
    """

    centers_m: Float64
    is_ignored: Bool
    found_m: Float64
    scores: Float64


@dataclass(frozen=True)
class CenterPrecision:
    """Precision of one class.

    Attributes:
        ap: Average precision, 0..1.
        labels: Number of labels that count.
        recall: Share of them that is found at any score.
    """

    ap: float
    labels: int
    recall: float


def center_precision(frames: Iterable[CenterFrame], distance_m: float) -> CenterPrecision:
    """Return the average precision over frames.

    Args:
        frames: Objects of each frame.
        distance_m: Largest distance of a detection from its label in metres.
    """
    scores, is_right, labels = [np.zeros(0)], [np.zeros(0, bool)], 0
    for frame in frames:
        labels += int((~frame.is_ignored).sum())
        matched = _matches(frame, distance_m)
        counts = (matched < 0) | ~np.append(frame.is_ignored, False)[matched]
        scores.append(frame.scores[counts])
        is_right.append(matched[counts] >= 0)
    order = np.argsort(-np.concatenate(scores), kind="stable")
    right = np.cumsum(np.concatenate(is_right)[order])
    if labels == 0 or not len(right) or right[-1] == 0:
        return CenterPrecision(0.0, labels, 0.0)
    precision, recall = right / np.arange(1, len(right) + 1), right / labels
    curve = np.interp(_RECALLS, recall, precision, right=0)[_RECALLS > _LOW]
    ap = float(np.clip(curve - _LOW, 0, None).mean() / (1 - _LOW))
    return CenterPrecision(ap, labels, float(recall[-1]))


def _matches(frame: CenterFrame, distance_m: float) -> np.ndarray:
    """Return (D,) the label of each detection, -1 without; better ones choose first, labels that count before others."""
    matched = np.full(len(frame.scores), -1)
    if not len(frame.centers_m):
        return matched
    gaps = np.linalg.norm(frame.found_m[:, None] - frame.centers_m[None], axis=2)
    is_free = np.ones(len(frame.centers_m), bool)
    for row in np.argsort(-frame.scores, kind="stable").tolist():
        near = np.flatnonzero((gaps[row] < distance_m) & is_free)
        if len(near):
            best = near[np.lexsort((gaps[row, near], frame.is_ignored[near]))[0]]
            matched[row] = best
            is_free[best] = frame.is_ignored[best]  # a group may be found more than once
    return matched
