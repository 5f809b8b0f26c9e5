"""Scores beside the share that is right, by hand-made numbers."""

import numpy as np
import pytest

from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.protocol import KITTI_CLASSES
from perception.evaluation.detection.reliability import (
    Rightness,
    measure_reliability,
    rightness,
)
from perception.types import Detections

CAR = KITTI_CLASSES[0]


def boxes_at(lefts):
    left = np.array(lefts, float)
    return np.stack([left, 0 * left + 10, left + 60, 0 * left + 60], axis=1)


def truths(lefts, types=None):
    count = len(lefts)
    return TrueBoxes(
        frames=np.zeros(count, np.int64),
        types=np.array(types or ["Car"] * count),
        alphas_rad=np.full(count, -10.0),
        boxes_px=boxes_at(lefts),
        truncation=np.zeros(count),
        occlusion=np.zeros(count),
    )


def found(lefts, scores):
    detections = Detections(boxes_at(lefts), np.array(scores), np.full(len(lefts), "Car"))
    return DetectedBoxes.of_frames([detections])


def test_bins_and_expected_error():
    # At about 0.9 three of four are right, at 0.2 none of two.
    scores = [0.95, 0.93, 0.91, 0.97, 0.2, 0.22]
    labelled = truths([0, 100, 200])
    told = rightness(labelled, found([0, 100, 200, 300, 400, 500], scores), 1, CAR)
    assert told.is_right.tolist() == [True, True, True, False, False, False]
    one = measure_reliability(told, bins=10)
    assert one.counts.tolist() == [2, 4]
    assert one.shares.tolist() == [0, 0.75]
    np.testing.assert_allclose(one.scores, [0.21, 0.94])
    assert one.expected_error == pytest.approx((2 * 0.21 + 4 * 0.19) / 6)


def test_an_object_is_found_once_by_the_surest():
    told = rightness(truths([0]), found([2, 0], [0.9, 0.5]), 1, CAR)
    assert told.is_right.tolist() == [True, False]


def test_what_need_not_be_found_is_neither_right_nor_wrong():
    for name in ("Van", "DontCare"):
        assert len(rightness(truths([0], [name]), found([0], [0.9]), 1, CAR).scores) == 0
    assert np.isnan(measure_reliability(Rightness(np.zeros(0), np.zeros(0, bool))).expected_error)


def test_the_highest_score_is_in_the_last_bin():
    one = measure_reliability(rightness(truths([0]), found([0], [1.0]), 1, CAR), bins=10)
    assert (one.counts.tolist(), one.expected_error) == ([1], 0)
