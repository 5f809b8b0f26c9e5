"""Mistakes are counted at the score at which they are fewest, frame by frame."""

import numpy as np

from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.frame_errors import count_frame_errors
from perception.evaluation.detection.protocol import DIFFICULTIES, KITTI_CLASSES
from perception.types import Detections

CAR, HARD = KITTI_CLASSES[0], DIFFICULTIES[-1]


def truths(frames):
    """Return a car a frame number given, side by side."""
    count = len(frames)
    left = 100.0 * np.arange(count)
    return TrueBoxes(
        frames=np.array(frames, np.int64),
        types=np.full(count, "Car"),
        alphas_rad=np.full(count, -10.0),
        boxes_px=np.stack([left, np.full(count, 10.0), left + 60, np.full(count, 60.0)], axis=1),
        truncation=np.zeros(count),
        occlusion=np.zeros(count),
    )


def at(lefts, scores):
    left = np.array(lefts, float)
    boxes_px = np.stack([left, 0 * left + 10, left + 60, 0 * left + 60], axis=1)
    return Detections(boxes_px, np.array(scores), np.full(len(left), "Car"))


def test_misses_and_false_alarms_of_each_frame():
    # Cars: two in frame 0, none in 1, one in 2. Found: both, a ghost, nothing; and a doubtful ghost.
    found = DetectedBoxes.of_frames([at([0, 100], [0.9, 0.8]), at([50], [0.85]), at([500], [0.1])])
    frame_errors = count_frame_errors(pair_boxes(truths([0, 0, 2]), found, 3), CAR, HARD)
    # At 0.9: one found, none wrong. At 0.8: two found, one wrong: as many mistakes, the surer is taken.
    assert frame_errors.threshold == 0.9
    assert frame_errors.false_negatives.tolist() == [1, 0, 1]
    assert frame_errors.false_positives.tolist() == [0, 0, 0]
    assert frame_errors.worst(5).tolist() == [0, 2]
    assert frame_errors.worst(1).tolist() == [0]


def test_detections_of_one_score_count_together():
    found = DetectedBoxes.of_frames([at([0, 100, 700], [0.5, 0.5, 0.5])])
    frame_errors = count_frame_errors(pair_boxes(truths([0, 0]), found, 1), CAR, HARD)
    assert frame_errors.threshold == 0.5
    assert (frame_errors.false_negatives.tolist(), frame_errors.false_positives.tolist()) == (
        [0],
        [1],
    )


def test_where_all_are_wrong_none_counts():
    found = DetectedBoxes.of_frames([at([700], [0.9])])
    frame_errors = count_frame_errors(pair_boxes(truths([0]), found, 1), CAR, HARD)
    assert frame_errors.threshold == np.inf
    assert (frame_errors.false_negatives.tolist(), frame_errors.false_positives.tolist()) == (
        [1],
        [0],
    )


def test_no_detections_are_false_negatives():
    frame_errors = count_frame_errors(
        pair_boxes(truths([1]), DetectedBoxes.of_frames([]), 2), CAR, HARD
    )
    assert frame_errors.false_negatives.tolist() == [0, 1]
    assert frame_errors.worst(3).tolist() == [1]
