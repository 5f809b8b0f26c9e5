"""Boxes from the cells of a bird's-eye view."""

import numpy as np
import pytest

from perception.detection.bev.bev_map import BevGrid
from perception.detection.bev.boxes import BevDetections, decode_boxes, suppress
from perception.detection.bev.classes import class_numbers
from perception.types import Boxes3D

GRID = BevGrid(reach_m=12.8, cell_m=0.2)  # 32 cells of 0.8 m


def test_a_cell_states_a_box_around_its_place():
    scores, cells = np.zeros((2, 32, 32), np.float32), np.zeros((16, 32, 32), np.float32)
    scores[1, 20, 3], scores[0, 1, 1], scores[0, 2, 2] = 0.6, 0.9, 0.04
    cells[:, 20, 3] = [0.25, 0.5, 0.1, 4, 2, 1.5, 0.6, 0, 0, -1, *([0.5] * 6)]
    found = decode_boxes(scores, cells, GRID)
    assert found.classes.tolist() == [0, 1]
    assert found.scores == pytest.approx([0.9, 0.6])
    # 20.25 cells of 0.8 m from -12.8 m, 3.5 of them.
    assert found.boxes.bottom_m[1] == pytest.approx([3.4, -10.0, 0.1])
    assert found.boxes.size_m[1] == pytest.approx([4, 2, 1.5])
    assert found.boxes.yaw_rad[1] == pytest.approx(np.pi / 2)
    assert found.reversals[1] == pytest.approx(0.2)
    assert found.deviations[1] == pytest.approx(np.full(6, np.sqrt(0.5)))


@pytest.mark.parametrize("yaw_rad", np.radians([-179, -91, -89, -1, 1, 89, 91, 179]))
def test_a_heading_is_that_end_of_the_axis_which_is_nearer(yaw_rad):
    scores, cells = np.ones((1, 1, 1), np.float32), np.zeros((16, 1, 1), np.float32)
    turned = yaw_rad + 0.5  # of an uncertain front
    cells[6:10, 0, 0] = [
        0.3 * np.sin(turned), 0.3 * np.cos(turned), np.sin(2 * yaw_rad), np.cos(2 * yaw_rad)
    ]  # fmt: skip
    found = decode_boxes(scores, cells, GRID)
    assert found.boxes.yaw_rad[0] == pytest.approx(yaw_rad, abs=1e-5)
    assert found.reversals[0] == pytest.approx((1 - 0.3 * np.cos(0.5)) / 2, abs=1e-5)


def test_a_peak_is_the_highest_of_its_neighbours_and_class():
    scores = np.full((2, 32, 32), 0.2, np.float32)
    scores[0, 4, 4], scores[0, 4, 5], scores[1, 4, 5], scores[0, 0, 0] = 0.9, 0.8, 0.7, 0.6
    found = decode_boxes(scores, np.ones((16, 32, 32), np.float32), GRID, min_score=0.5)
    assert found.scores == pytest.approx([0.9, 0.7, 0.6])
    assert len(decode_boxes(scores, np.ones((16, 32, 32), np.float32), GRID, 0.5, most=2)) == 2


def test_no_box_is_detected_where_no_score_is_high():
    found = decode_boxes(
        np.zeros((2, 32, 32), np.float32), np.zeros((16, 32, 32), np.float32), GRID
    )
    assert len(found) == 0
    assert len(suppress(found, (0, 0))) == 0


def test_the_best_of_one_group_stays_at_a_place():
    places = np.array([[0, 0, 0], [0.5, 0, 0], [0.5, 0, 0], [5, 0, 0]], float)
    boxes = Boxes3D(places, np.tile([4.0, 1.8, 1.5], (4, 1)), np.zeros(4))
    found = BevDetections(boxes, np.array([0, 1, 2, 0]), np.array([0.9, 0.8, 0.7, 0.6]), np.zeros((4, 6)), np.zeros(4))  # fmt: skip
    # A van is a car's group, a pedestrian is not.
    assert suppress(found, (0, 0, 1)).scores.tolist() == [0.9, 0.7, 0.6]


def test_types_of_labels_in_any_case_are_classes():
    assert class_numbers(["car", "Person_sitting", "Tram", "Bus"], ("Pedestrian", "Car")) == [1, 0, -1, -1]  # fmt: skip
