"""Which detections are right, and whether scores say how often: by hand."""

import numpy as np
import pytest

from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.protocol import KITTI_CLASSES
from perception.evaluation.detection.reliability import (
    Correctness,
    match_correctness,
    measure_reliability,
)
from perception.types import Detections

CAR = KITTI_CLASSES[0]


def truth_of(*rows) -> TrueBoxes:
    zeros = np.zeros(len(rows))
    boxes_px = np.array([box for _, _, box in rows], float)
    types = np.array([name for _, name, _ in rows])
    frames = np.array([frame for frame, _, _ in rows])
    return TrueBoxes(frames, types, zeros - 10, boxes_px, zeros, zeros)


def found_in(*frames) -> DetectedBoxes:
    return DetectedBoxes.of_frames(
        [
            Detections(
                np.array([box for box, _ in rows], float).reshape(-1, 4),
                np.array([score for _, score in rows], float),
                np.full(len(rows), "Car"),
            )
            for rows in frames
        ]
    )


def test_an_object_is_found_once_by_the_surest():
    box, near = [0, 0, 100, 50], [2, 0, 102, 50]
    truth = truth_of((0, "Car", box), (1, "Car", box))
    found = found_in([(near, 0.9), (box, 0.6), ([300, 0, 400, 50], 0.5)], [(box, 0.4)])
    correctness = match_correctness(pair_boxes(truth, found, 2), CAR)
    assert correctness.scores.tolist() == [0.9, 0.6, 0.5, 0.4]
    assert correctness.is_correct.tolist() == [True, False, False, True]


def test_two_objects_side_by_side_are_both_found():
    left, right = [0, 0, 100, 50], [10, 0, 110, 50]  # overlap by 0.82
    truth = truth_of((0, "Car", left), (0, "Car", right))
    correctness = match_correctness(
        pair_boxes(truth, found_in([(right, 0.9), (right, 0.8)]), 1), CAR
    )
    assert correctness.is_correct.tolist() == [True, True]


def test_vans_and_regions_without_labels_do_not_count():
    truth = truth_of((0, "Van", [0, 0, 100, 50]), (0, "DontCare", [200, 0, 400, 100]))
    found = found_in([([0, 0, 100, 50], 0.9), ([250, 10, 300, 50], 0.8), ([390, 0, 500, 9], 0.7)])
    correctness = match_correctness(pair_boxes(truth, found, 1), CAR)
    assert correctness.scores.tolist() == [0.7]
    assert correctness.is_correct.tolist() == [False]


def test_the_expected_error_by_hand():
    scores = np.array([0.1, 0.2, 0.6, 0.8, 0.9, 0.9])
    is_correct = np.array([False, True, False, True, True, True])
    found = measure_reliability(Correctness(scores, is_correct), bins=2)
    np.testing.assert_allclose(found.scores, [0.15, 0.8])
    np.testing.assert_allclose(found.shares, [0.5, 0.75])
    assert found.counts.tolist() == [2, 4]
    assert found.expected_calibration_error == pytest.approx((2 * 0.35 + 4 * 0.05) / 6)


def test_a_score_of_one_is_in_the_last_bin_and_no_scores_have_no_error():
    whole = measure_reliability(Correctness(np.array([1.0, 0.0]), np.array([True, False])), bins=4)
    assert whole.expected_calibration_error == 0
    assert np.isnan(
        measure_reliability(Correctness(np.zeros(0), np.zeros(0, bool))).expected_calibration_error
    )
