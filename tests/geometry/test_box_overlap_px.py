"""Overlap of boxes in the image."""

import numpy as np

from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px

BOXES = np.array([[0.0, 0, 10, 10], [5, 5, 15, 15], [20, 0, 30, 5], [10, 0, 20, 10]])


def test_iou():
    expected = [[1, 25 / 175, 0, 0], [25 / 175, 1, 0, 25 / 175]]
    np.testing.assert_allclose(iou_px(BOXES[:2], BOXES), expected)


def test_the_share_of_a_box_in_another():
    inside, around = np.array([[2.0, 2, 4, 6]]), np.array([[0.0, 0, 3, 10], [0, 0, 100, 100]])
    assert intersection_over_area_px(inside, around).tolist() == [[0.5, 1]]
    assert intersection_over_area_px(around, inside).tolist() == [[4 / 30], [8 / 10000]]


def test_boxes_without_area_have_no_overlap():
    point, inverted = np.array([[3.0, 3, 3, 9]]), np.array([[9.0, 9, 3, 3]])
    for box in (point, inverted):
        assert iou_px(box, BOXES[:1]).tolist() == [[0]]
        assert intersection_over_area_px(box, BOXES[:1]).tolist() == [[0]]
    assert iou_px(point, point).tolist() == [[0]]


def test_no_boxes():
    assert iou_px(np.zeros((0, 4)), BOXES).shape == (0, 4)
    assert intersection_over_area_px(BOXES, np.zeros((0, 4))).shape == (4, 0)
