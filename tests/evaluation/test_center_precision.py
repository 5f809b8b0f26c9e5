"""Average precision by the distance of centres, against values worked out by hand."""

import numpy as np
import pytest

from perception.evaluation.detection.center_precision import CenterFrame, center_precision


def frame(labels, ignored, found, scores) -> CenterFrame:
    """Return a frame of objects along x."""
    places = [np.column_stack([one, np.zeros(len(one))]).reshape(-1, 2) for one in (labels, found)]
    return CenterFrame(places[0], np.array(ignored, bool), places[1], np.array(scores, float))


def test_what_is_found_within_the_distance_is_right():
    frames = [
        frame([0, 10], [0, 0], [1.9, 10.1], [0.9, 0.8]),
        frame([0], [0], [0.5], [0.7]),
    ]
    result = center_precision(frames, 2.0)
    assert (result.ap, result.labels, result.recall) == pytest.approx((1, 3, 1))


def test_recall_bounds_the_precision():
    # Right, wrong, right, and one label never found: precision 1, 1/2, 2/3 at recalls 1/3, 1/3, 2/3.
    result = center_precision([frame([0, 10, 20], [0] * 3, [0, 5, 10], [0.9, 0.8, 0.7])], 2.0)
    recalls = np.linspace(0, 1, 101)[11:]
    curve = np.interp(recalls, [1 / 3, 1 / 3, 2 / 3], [1, 1 / 2, 2 / 3], right=0)
    assert result.ap == pytest.approx(np.clip(curve - 0.1, 0, None).mean() / 0.9)
    assert result.recall == pytest.approx(2 / 3)


def test_a_label_is_found_once_by_the_best():
    result = center_precision([frame([0], [0], [0.5, 0.1], [0.9, 0.8])], 2.0)
    # Of two precisions at one recall, NumPy's interpolation takes the later one, as the benchmark's does.
    assert result.ap == pytest.approx(1 - 0.5 / 0.9 / 90)
    assert center_precision([frame([0], [0], [3, 0.1], [0.9, 0.8])], 2.0).ap < 0.6


def test_an_ignored_label_makes_no_detection_wrong():
    result = center_precision([frame([0, 1], [0, 1], [1.0, 0.2, 1.5], [0.9, 0.8, 0.7])], 2.0)
    assert (result.ap, result.labels) == pytest.approx((1, 1))


def test_precision_is_zero_without_detections_or_labels():
    assert center_precision([frame([0], [0], [], [])], 2.0).ap == 0
    assert center_precision([frame([], [], [0], [0.9])], 2.0).labels == 0
