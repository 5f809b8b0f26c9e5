"""Coverage of true objects by tracks, by hand-made frames."""

import math

import numpy as np

from perception.evaluation.multi_object.coverage import Coverage

_BOXES_PX = np.array([[0.0, 0, 10, 10], [100, 0, 110, 10], [200, 0, 210, 10]])
_NONE = np.zeros((0, 4))


def test_objects_detected_in_three_frames_should_have_an_id():
    coverage = Coverage()
    range_m = np.array([10.0, 30.0, 40.0])
    for frame in range(4):
        views = [_BOXES_PX[[0]], _BOXES_PX[[1]] if frame < 3 else _NONE]
        tracked_px = _BOXES_PX[[0]] + 1 if frame == 3 else _NONE
        coverage.update(np.array([7, 8, 9]), _BOXES_PX, range_m, views, tracked_px)
    near, far = coverage.compute(0, 25), coverage.compute(25, 50)
    assert (near.detected, near.tracked) == (1, 1.0)
    assert (far.detected, far.tracked) == (1, 0.0)


def test_objects_detected_more_seldom_do_not_count():
    coverage = Coverage()
    for _ in range(2):
        coverage.update(np.array([7]), _BOXES_PX[[0]], np.array([10.0]), [_BOXES_PX], _NONE)
    nothing = coverage.compute(0, math.inf)
    assert nothing.detected == 0
    assert math.isnan(nothing.tracked)


def test_without_detectors_no_car_is_detected():
    coverage = Coverage()
    coverage.update(np.array([7]), _BOXES_PX[[0]], np.array([10.0]), [], _BOXES_PX)
    assert coverage.compute(0, math.inf).detected == 0
