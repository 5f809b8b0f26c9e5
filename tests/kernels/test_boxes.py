"""Compiled functions of upright boxes, each beside a plain loop."""

import numpy as np
import pytest

from benchmarks.reference.depthcn import suppress_by_loop
from perception.kernels.boxes import iou_of_all, unsuppressed


def scattered(seed: int, count: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    corner = random.integers(0, 30, (count, 2))
    # Whole numbers, some of them 0: boxes without area, boxes that touch, and equal boxes.
    return np.hstack([corner, corner + random.integers(0, 12, (count, 2))]).astype(float)


def reference_iou(a: np.ndarray, b: np.ndarray) -> float:
    pixels = np.zeros((2, 50, 50), bool)
    for mask, box in zip(pixels, (a, b), strict=True):
        x1, y1, x2, y2 = box.astype(int)
        mask[y1:y2, x1:x2] = True
    union = (pixels[0] | pixels[1]).sum()
    return (pixels[0] & pixels[1]).sum() / union if union else 0.0


def test_iou_equals_counted_pixels():
    a, b = scattered(0, 20), scattered(1, 15)
    expected = [[reference_iou(one, other) for other in b] for one in a]
    np.testing.assert_allclose(iou_of_all(a, b), expected, atol=1e-12)


def test_iou_of_unknown_boxes_is_zero():
    unknown = np.full((1, 4), np.nan)
    assert iou_of_all(unknown, scattered(0, 3)).tolist() == [[0.0] * 3]
    assert iou_of_all(np.zeros((0, 4)), scattered(0, 3)).shape == (0, 3)


@pytest.mark.parametrize("max_iou", [0.1, 0.5, 1.0])
def test_unsuppressed_equals_a_loop_for_each_class(max_iou):
    boxes = scattered(2, 60)
    classes = np.arange(60) % 2
    scores = np.linspace(1, 0.1, 60)
    found = np.flatnonzero(unsuppressed(boxes, classes, max_iou))
    expected = [
        of_class[suppress_by_loop(boxes[of_class], scores[of_class], max_iou)]
        for of_class in (np.flatnonzero(classes == 0), np.flatnonzero(classes == 1))
    ]
    assert found.tolist() == sorted(np.concatenate(expected).tolist())
