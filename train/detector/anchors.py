"""Anchor boxes from the sizes of labels: k-means with 1 - IoU as distance.

Section 2, "Dimension clusters", of Redmon and Farhadi, "YOLO9000: better, faster, stronger", CVPR 2017.
"""

from dataclasses import dataclass

import numpy as np

from perception.errors import LabelError
from perception.types import Float64, Int

_MAX_ROUNDS = 300


@dataclass(frozen=True)
class AnchorFit:
    """Anchors and how well they fit.

    Attributes:
        anchors_px: (A, 2) widths and heights in pixels, small to large.
        mean_iou: Mean IoU of each label with its best anchor, both with one common corner.
    """

    anchors_px: Float64
    mean_iou: float


def fit_anchors(sizes_px: Float64, count: int, rng: np.random.Generator) -> AnchorFit:
    """Return the anchors that labels gather around.

    Args:
        sizes_px: (N, 2) widths and heights of labels in pixels of the network's input.
        count: Number of anchors.
        rng: Random generator of the first anchors.

    Raises:
        LabelError: fewer different sizes than anchors, or sizes that are not over zero.
    """
    _require_sizes(sizes_px, count)
    anchors = _first_anchors(sizes_px, count, rng)
    nearest = _nearest(sizes_px, anchors)
    for _ in range(_MAX_ROUNDS):
        anchors = _means(sizes_px, anchors, nearest)
        before, nearest = nearest, _nearest(sizes_px, anchors)
        if np.array_equal(before, nearest):
            break
    anchors = anchors[np.argsort(anchors.prod(axis=1), kind="stable")]
    return AnchorFit(anchors, float(shape_iou(sizes_px, anchors).max(axis=1).mean()))


def shape_iou(a_px: Float64, b_px: Float64) -> Float64:
    """Return (A, B) overlaps of sizes (A, 2) and (B, 2) laid on one corner."""
    common = np.minimum(a_px[:, None], b_px[None]).prod(axis=2)
    return np.asarray(common / (a_px.prod(axis=1)[:, None] + b_px.prod(axis=1) - common))


def _first_anchors(sizes_px: Float64, count: int, rng: np.random.Generator) -> Float64:
    """Draw labels, each the likelier the less the ones before it fit (k-means++)."""
    anchors = sizes_px[rng.integers(len(sizes_px), size=1)]
    while len(anchors) < count:
        distance = _squared_distance(sizes_px, anchors)
        drawn = rng.choice(len(sizes_px), p=distance / distance.sum())
        anchors = np.vstack([anchors, sizes_px[drawn]])
    return anchors


def _squared_distance(sizes_px: Float64, anchors: Float64) -> Float64:
    """Return (N,) squared distances to the nearest anchor, exactly 0 where it is one."""
    distance = np.asarray((1 - shape_iou(sizes_px, anchors).max(axis=1)) ** 2)
    return np.where(distance < 1e-20, 0.0, distance)


def _nearest(sizes_px: Float64, anchors: Float64) -> Int:
    return np.asarray(shape_iou(sizes_px, anchors).argmax(axis=1))


def _means(sizes_px: Float64, anchors: Float64, nearest: Int) -> Float64:
    """Return the mean size of each cluster; an empty one restarts at the label that fits worst."""
    counts = np.bincount(nearest, minlength=len(anchors))
    sums = np.stack(
        [np.bincount(nearest, weights=side, minlength=len(anchors)) for side in sizes_px.T], axis=1
    )
    means = sums / np.maximum(counts, 1)[:, None]
    for empty in np.flatnonzero(counts == 0):
        filled = np.delete(means, np.flatnonzero(counts == 0), axis=0)
        means[empty] = sizes_px[_squared_distance(sizes_px, filled).argmax()]
        counts[empty] = 1
    return np.asarray(means)


def _require_sizes(sizes_px: Float64, count: int) -> None:
    if not np.isfinite(sizes_px).all() or (sizes_px <= 0).any():
        raise LabelError("label sizes", expected="widths and heights over zero", found="others")
    different = len(np.unique(sizes_px, axis=0))
    if different < count:
        raise LabelError(
            "label sizes",
            expected=f"at least {count} different ones for {count} anchors",
            found=f"{different}",
            advice="ask for fewer anchors, or give more labels",
        )
