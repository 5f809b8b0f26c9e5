"""Of detections of one place only the best stays."""

import numpy as np
import pytest
import torch
from torchvision import ops

from benchmarks.reference.depthcn import suppress_by_loop
from perception.detection.suppression import suppress
from perception.types import Detections


def detections(boxes, scores, types="Car"):
    return Detections(
        np.array(boxes, float).reshape(-1, 4),
        np.array(scores, float),
        np.broadcast_to(np.array(types), (len(scores),)).astype(str),
    )


def test_best_of_two_that_overlap_stays():
    boxes = [[0, 0, 10, 10], [1, 0, 11, 10], [50, 0, 60, 10]]
    assert suppress(detections(boxes, [0.5, 0.9, 0.1]), 0.5).tolist() == [1, 2]


def test_overlap_at_the_limit_stays():
    # Half of the union: 2 of 3 columns each, one shared third ... 10 x 10 in 10 x 20.
    boxes = [[0, 0, 10, 20], [0, 0, 10, 10]]
    assert suppress(detections(boxes, [0.9, 0.8]), 0.5).tolist() == [0, 1]
    assert suppress(detections(boxes, [0.9, 0.8]), 0.49).tolist() == [0]


def test_chain_keeps_what_only_a_suppressed_one_overlaps():
    boxes = [[0, 0, 10, 10], [3, 0, 13, 10], [6, 0, 16, 10], [9, 0, 19, 10]]
    assert suppress(detections(boxes, [0.9, 0.8, 0.7, 0.6]), 0.5).tolist() == [0, 2]


def test_another_class_does_not_suppress():
    boxes = [[0, 0, 10, 10], [0, 0, 10, 10]]
    both = detections(boxes, [0.5, 0.9], ["Car", "Cyclist"])
    assert suppress(both, 0.5).tolist() == [1, 0]


def test_equal_scores_stay_in_their_order():
    boxes = [[0, 0, 10, 10], [50, 0, 60, 10], [0, 0, 10, 10]]
    assert suppress(detections(boxes, [0.5, 0.5, 0.5]), 0.5).tolist() == [0, 1]


def test_no_boxes_keep_no_boxes():
    assert suppress(Detections.empty(), 0.5).tolist() == []


def test_box_without_area_stays_alone():
    assert suppress(detections([[5, 5, 5, 9], [5, 5, 5, 9]], [0.5, 0.4]), 0.5).tolist() == [0, 1]


@pytest.mark.parametrize("seed", range(20))
def test_same_as_by_loop(seed):
    generator = np.random.default_rng(seed)
    corner = generator.uniform(0, 60, (80, 2))
    boxes = np.hstack([corner, corner + generator.uniform(5, 40, (80, 2))])
    scores = generator.uniform(size=80).round(1)
    found = suppress(detections(boxes, scores), 0.4)
    assert found.tolist() == suppress_by_loop(boxes, scores, 0.4)
    assert 5 < len(found) < 75


@pytest.mark.parametrize("seed", range(5))
def test_same_as_by_torchvision(seed):
    generator = np.random.default_rng(seed)
    corner = generator.uniform(0, 60, (80, 2))
    boxes = np.hstack([corner, corner + generator.uniform(5, 40, (80, 2))])
    scores, classes = generator.permutation(80) / 80, generator.integers(0, 3, 80)
    found = suppress(detections(boxes, scores, np.array(["Car", "Van", "Tram"])[classes]), 0.4)
    expected = ops.batched_nms(*(torch.from_numpy(one) for one in (boxes, scores, classes)), 0.4)
    assert found.tolist() == expected.tolist()
    assert len(found) < 75
