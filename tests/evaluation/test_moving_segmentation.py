import math
from dataclasses import replace

import numpy as np
import pytest

from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.confusion import Confusion
from perception.evaluation.moving_segmentation import (
    MotionCounts,
    count_motion,
    speeds_of,
    truth_of_boxes,
)
from perception.evaluation.objects import LabelledObjects, MotionState
from perception.types import Boxes3D, PointState, PointTruth
from tests.known_result import known_result

CAR, BUILDING = 10, 50
CONFIG = ObjectMatchConfig(min_points=20, moving_share=0.25)


def counts_of(blocks, speeds_m_s):
    """Count blocks of 30 points, 5 m apart: their instance, whether they move, their state and their class."""
    points = np.zeros((30 * len(blocks), 4))
    points[:, 0] = np.repeat(5.0 * np.arange(1, len(blocks) + 1), 30)
    instances, moves, states, classes = (np.repeat(one, 30) for one in zip(*blocks, strict=True))
    result = known_result(0)
    result = replace(
        result,
        frame=replace(result.frame, points_velo=points.astype(np.float32)),
        obstacles=replace(result.obstacles, point_states=states.astype(np.uint8)),
    )
    return count_motion(result, PointTruth(classes, instances, moves), CONFIG, speeds_m_s)


def test_moving_points_objects_and_false_clusters_are_counted():
    counts = counts_of(
        [
            (1, True, PointState.MOVING, CAR),
            (2, True, PointState.STATIC, CAR),
            (0, False, PointState.MOVING, BUILDING),
            (0, False, PointState.MOVING, 0),
            (3, True, PointState.OUTSIDE, CAR),
            (4, False, PointState.STATIC, CAR),
        ],
        {1: 1.0, 2: 12.0, 4: 0.0},
    )
    assert counts["all"] == MotionCounts(1, Confusion(30, 30, 30), 2, 1, 1)
    assert counts["under 2 m/s"] == MotionCounts(0, Confusion(30, 0, 0), 1, 0, 0)
    assert counts["over 10 m/s"] == MotionCounts(0, Confusion(0, 0, 30), 1, 1, 0)
    both = counts["all"] + counts["all"]
    assert (both.iou, both.missed_share, both.false_a_scan) == pytest.approx((1 / 3, 0.5, 1.0))
    assert math.isnan(MotionCounts().false_a_scan)


def test_points_move_by_the_boxes_of_moving_objects():
    boxes = Boxes3D(
        np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0]]), np.full((3, 3), 2.0), np.zeros(3)
    )
    motions = np.array([MotionState.MOVING, MotionState.STATIC, MotionState.UNKNOWN])
    objects = LabelledObjects(boxes, motions, np.array([4, 5, 6]))
    points = np.ones((6, 3))
    points[:, 0], points[1, 2] = (0, 0, 1.3, 3, 10, 20), 0.1
    points[:, 1] = 0
    truth = truth_of_boxes(points, objects, None, clearance_m=0.2)
    assert truth.is_moving.tolist() == [True, False, False, False, False, False]
    assert (truth.classes > 0).tolist() == [True, False, False, True, True, False]
    assert truth.instances.tolist() == [5, 0, 0, 0, 6, 0]


def test_speeds_are_found_by_the_instance():
    assert speeds_of(np.array([3]), np.array([[3.0, 4.0]])) == {4: 5.0}
