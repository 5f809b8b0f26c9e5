"""Average precision by the distance of centres, against values worked out by hand."""

import numpy as np
import pytest
import torch

from train.bev.metrics import CenterPrecision, measure

RECALLS = np.linspace(0, 1, 101)[11:]


def precision(*scans, views=None) -> CenterPrecision:
    """Return the precision of scans of objects along x: labels, whether they are ignored, detections, scores."""
    targets, rows = [], []
    for number, (labels, ignored, found, scores) in enumerate(scans):
        boxes = torch.zeros(len(labels), 7)
        boxes[:, 0] = torch.tensor(labels, dtype=torch.float32)
        view = torch.tensor(views[number] if views else (0.0, np.pi), dtype=torch.float32)
        classes, is_ignored = torch.zeros(len(labels), dtype=torch.int64), torch.tensor(ignored).bool()  # fmt: skip
        targets.append({"boxes": boxes, "classes": classes, "is_ignored": is_ignored, "view_rad": view})  # fmt: skip
        rows += [[number, 0, 0, score, x, 0] for x, score in zip(found, scores, strict=True)]
    return measure(targets, torch.tensor(rows).reshape(-1, 6), ("Car", "Van"))["Car"]


def average(precisions, recalls) -> float:
    """Return the average of a curve."""
    curve = np.interp(RECALLS, recalls, precisions, right=0)
    return float(np.clip(curve - 0.1, 0, None).mean() / 0.9)


def test_what_is_found_within_the_distance_is_right():
    found = precision(([0, 10], [0, 0], [1.9, 10.1], [0.9, 0.8]), ([0], [0], [0.4], [0.7]))
    assert (found.ap, found.labels, found.recall) == pytest.approx((1, 3, 1))
    # Within 1 m the first detection is wrong, and one of three labels is not found.
    below = average([0, 1 / 2, 2 / 3], [0, 1 / 3, 2 / 3])
    assert found.mean_ap == pytest.approx((2 * below + 2) / 4)


def test_recall_bounds_the_precision():
    # Right, wrong, right, and one label never found: precision 1, 1/2, 2/3 at recalls 1/3, 1/3, 2/3.
    found = precision(([0, 10, 20], [0] * 3, [0, 5, 10], [0.9, 0.8, 0.7]))
    assert found.ap == pytest.approx(average([1, 1 / 2, 2 / 3], [1 / 3, 1 / 3, 2 / 3]))
    assert found.recall == pytest.approx(2 / 3)


def test_a_label_is_found_once_by_the_best():
    # Of two precisions at one recall, NumPy's interpolation takes the later one, as the benchmark's does.
    assert precision(([0], [0], [0.5, 0.1], [0.9, 0.8])).ap == pytest.approx(1 - 0.5 / 0.9 / 90)
    assert precision(([0], [0], [3, 0.1], [0.9, 0.8])).ap < 0.6


def test_an_ignored_label_makes_no_detection_wrong():
    found = precision(([0, 1], [0, 1], [1.0, 0.2, 1.5], [0.9, 0.8, 0.7]))
    assert (found.ap, found.labels) == pytest.approx((1, 1))


def test_a_detection_counts_only_where_its_scan_is_labelled():
    scan = ([10], [0], [10, -10], [0.8, 0.9])
    assert precision(scan, views=[(0.0, 1.0)]).ap == pytest.approx(1)
    assert precision(scan).ap < 0.6


def test_precision_is_zero_without_detections_or_labels():
    assert precision(([0], [0], [], [])).ap == 0
    assert precision(([], [], [0], [0.9])).labels == 0
