"""Which objects proposals reach, on boxes small enough to check by eye."""

import numpy as np
import pytest

from perception.errors import PerceptionError
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.proposal_recall import (
    IOU_STEPS,
    count_recalled,
    proposal_recall,
)

TALL, LOW = [0.0, 0, 100, 100], [200.0, 0, 300, 30]  # 100 and 30 px high: the low one is not easy
HALF_OF_TALL = [0.0, 0, 100, 60]  # IoU 0.6
FAR = [500.0, 0, 600, 100]


def truths(rows):
    """Rows of frame, type, box, occlusion."""
    frames, types, boxes, occlusion = zip(*rows, strict=True) if rows else ([], [], [], [])
    return TrueBoxes(
        frames=np.array(frames, int),
        types=np.array(types, np.str_),
        alphas_rad=np.full(len(rows), -10.0),
        boxes_px=np.array(boxes, float).reshape(-1, 4),
        truncation=np.zeros(len(rows)),
        occlusion=np.array(occlusion, float),
    )


def proposals(rows):
    """Rows of frame, box, score."""
    frames, boxes, scores = zip(*rows, strict=True) if rows else ([], [], [])
    return DetectedBoxes(
        frames=np.array(frames, int),
        types=np.full(len(rows), "Car"),
        alphas_rad=np.full(len(rows), -10.0),
        boxes_px=np.array(boxes, float).reshape(-1, 4),
        scores=np.array(scores, float),
    )


LABELLED = truths(
    [(0, "Car", TALL, 0), (0, "Car", LOW, 0), (1, "car", TALL, 3), (1, "Van", FAR, 0)]
)
FOUND = proposals(
    [(0, FAR, 9.0), (0, TALL, 1.0), (0, LOW, 5.0), (1, HALF_OF_TALL, 0.2), (1, FAR, 0.1)]
)


def test_objects_are_counted_by_difficulty_and_reached_by_overlap():
    recall = proposal_recall(pair_boxes(LABELLED, FOUND, 2), "Car")
    assert (recall.frames, recall.proposals, recall.max_per_frame) == (2, 5, 3)
    assert recall.proposals_per_frame == 2.5
    metrics = recall.difficulties
    assert {name: one.objects for name, one in metrics.items()} == {
        "easy": 1,
        "moderate": 2,
        "hard": 2,
        "all": 3,
    }
    assert (metrics["all"].found(0.7), metrics["all"].found(0.5)) == (2, 3)
    assert metrics["all"].recall(0.7) == pytest.approx(2 / 3)
    assert metrics["hard"].recall(0.7) == 1.0


def test_the_highest_scores_of_each_frame_come_first():
    metrics = proposal_recall(pair_boxes(LABELLED, FOUND, 2), "Car").difficulties["all"]
    # Frame 0: far, low, tall; frame 1: half of tall.
    np.testing.assert_array_equal(metrics.ranks[0.5], [2, 1, 0])
    np.testing.assert_array_equal(metrics.ranks[0.7], [2, 1, -1])
    np.testing.assert_allclose(metrics.recall_by_count(0.5, 4), np.array([0, 1, 2, 3, 3]) / 3)
    np.testing.assert_allclose(metrics.recall_by_count(0.7, 2), np.array([0, 0, 1]) / 3)


def test_recall_falls_with_the_overlap_that_is_asked():
    metrics = proposal_recall(pair_boxes(LABELLED, FOUND, 2), "Car").difficulties["all"]
    np.testing.assert_allclose(metrics.best_iou, [1, 1, 0.6])
    curve = metrics.recall_by_iou()
    assert len(curve) == len(IOU_STEPS) == 101
    np.testing.assert_allclose(curve[[0, 50, 61, 100]], [1, 1, 2 / 3, 2 / 3])


def test_one_proposal_may_reach_several_objects_and_equal_overlap_is_enough():
    both = truths([(0, "Car", TALL, 0), (0, "Car", HALF_OF_TALL, 0)])
    found = proposals([(0, HALF_OF_TALL, 1.0)])
    assert (
        proposal_recall(pair_boxes(both, found, 1), "car", [0.6]).difficulties["all"].found(0.6)
        == 2
    )


def test_counting_one_frame_agrees_with_measuring_all():
    in_frame = LABELLED.frames == 0
    counts = count_recalled(
        LABELLED.boxes_px[in_frame], FOUND.boxes_px[FOUND.frames == 0], (0.7, 0.5)
    )
    np.testing.assert_array_equal(counts, [2, 2])
    none = np.zeros((0, 4))
    np.testing.assert_array_equal(count_recalled(none, FOUND.boxes_px, (0.7,)), [0])
    np.testing.assert_array_equal(count_recalled(LABELLED.boxes_px, none, (0.7, 0.5)), [0, 0])


def test_without_proposals_recall_is_zero():
    recall = proposal_recall(pair_boxes(LABELLED, proposals([]), 2), "Car")
    assert (recall.proposals, recall.max_per_frame) == (0, 0)
    metrics = recall.difficulties["all"]
    assert metrics.recall(0.5) == 0
    np.testing.assert_array_equal(metrics.recall_by_count(0.5, 3), np.zeros(4))
    np.testing.assert_array_equal(metrics.recall_by_iou(), np.zeros(101))


def test_of_no_objects_there_is_no_share():
    metrics = proposal_recall(pair_boxes(LABELLED, FOUND, 2), "Cyclist").difficulties["all"]
    assert metrics.objects == 0
    assert np.isnan(metrics.recall(0.7))
    assert np.isnan(metrics.recall_by_count(0.7, 5)).all()
    assert np.isnan(metrics.recall_by_iou()).all()


@pytest.mark.parametrize("iou", [0.0, 1.2, float("nan")])
def test_an_overlap_that_is_no_demand_is_refused(iou):
    with pytest.raises(PerceptionError) as error:
        proposal_recall(pair_boxes(LABELLED, FOUND, 2), "Car", [iou])
    assert (error.value.expected, error.value.found) == ("above 0, at most 1", f"{iou:g}")
