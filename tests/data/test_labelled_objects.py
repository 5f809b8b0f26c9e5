"""Points within boxes."""

import numpy as np

from data.labels_in_view import box_owners
from perception.types import Boxes3D


def test_a_point_belongs_to_the_smallest_box_around_it():
    boxes = Boxes3D(
        np.array([[10.0, 0, -1], [10.0, 0, -1]]), np.array([[4.0, 2, 2], [1.0, 1, 2]]), np.zeros(2)
    )
    points = np.array([[10.0, 0, 0], [11.5, 0, 0], [20.0, 0, 0]])
    assert box_owners(boxes, points).tolist() == [1, 0, -1]
    assert box_owners(boxes[::-1], points).tolist() == [0, 1, -1]


def test_boxes_are_grown_but_for_their_bottom():
    box = Boxes3D(np.array([[10.0, 0, -1]]), np.array([[4.0, 2, 2]]), np.zeros(1))
    points = np.array([[12.09, 0, 0], [12.11, 0, 0], [10, 0, 1.09], [10, 0, -1.05]])
    assert box_owners(box, points).tolist() == [0, -1, 0, -1]
    assert box_owners(Boxes3D.empty(), points).tolist() == [-1] * 4
