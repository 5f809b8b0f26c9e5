"""Boxes from the cells of a bird's-eye view."""

import numpy as np
import pytest
from scipy.ndimage import maximum_filter

from perception.detection.bev.bev_map import BevGrid
from perception.detection.bev.boxes import BevDetections, decode_boxes, suppress
from perception.detection.bev.classes import class_numbers
from perception.types import Boxes3D

GRID = BevGrid(reach_m=6.4, cell_m=0.2)  # 16 blocks a side, of 2x2 places of 0.4 m


def in_blocks(planes):
    """Return (K, R, R) planes of places as the network orders them."""
    kinds, side, _ = planes.shape
    split = planes.reshape(kinds, side // 2, 2, side // 2, 2).transpose(0, 2, 4, 1, 3)
    return np.ascontiguousarray(split.reshape(4 * kinds, side // 2, side // 2), np.float32)


def logits(scores):
    return in_blocks(np.log(scores / (1 - scores)))


def boxes_of(*stated, side=32):
    """Return predictions, alike but for those of some places."""
    planes = np.ones((16, side, side))
    for (row, column), values in stated:
        planes[:, row, column] = values
    return in_blocks(planes)


def test_a_place_states_a_box_around_it():
    scores = np.full((2, 32, 32), 0.01)
    scores[1, 21, 3], scores[0, 1, 1], scores[0, 2, 2] = 0.6, 0.9, 0.04
    size, scales = np.log([4, 2, 1.5]), np.log([0.5] * 6)
    stated = [0.25, 0.5, 0.1, *size, 0.6, 0, 0, -1, *scales]
    found = decode_boxes(logits(scores), boxes_of(((21, 3), stated)), GRID)
    assert found.classes.tolist() == [0, 1]
    assert found.scores == pytest.approx([0.9, 0.6])
    # 21.25 places of 0.4 m from -6.4 m, 3.5 of them.
    assert found.boxes.bottom_m[1] == pytest.approx([2.1, -5.0, 0.1])
    assert found.boxes.size_m[1] == pytest.approx([4, 2, 1.5])
    assert found.boxes.yaw_rad[1] == pytest.approx(np.pi / 2)
    assert found.reversals[1] == pytest.approx(0.2)
    assert found.deviations[1] == pytest.approx(np.full(6, np.sqrt(0.5)))


@pytest.mark.parametrize("yaw_rad", np.radians([-179, -91, -89, -1, 1, 89, 91, 179]))
def test_a_heading_is_that_end_of_the_axis_which_is_nearer(yaw_rad):
    scores, stated = np.full((1, 2, 2), 0.01), np.zeros(16)
    scores[0, 0, 1] = 0.9
    turned = yaw_rad + 0.5  # of an uncertain front
    stated[6:10] = [
        0.3 * np.sin(turned), 0.3 * np.cos(turned), np.sin(2 * yaw_rad), np.cos(2 * yaw_rad)
    ]  # fmt: skip
    found = decode_boxes(logits(scores), boxes_of(((0, 1), stated), side=2), GRID)
    assert found.boxes.yaw_rad[0] == pytest.approx(yaw_rad, abs=1e-5)
    assert found.reversals[0] == pytest.approx((1 - 0.3 * np.cos(0.5)) / 2, abs=1e-5)


def test_a_peak_is_the_highest_of_its_neighbours_and_class():
    scores = np.full((2, 32, 32), 0.2)
    scores[0, 4, 4], scores[0, 4, 5], scores[1, 4, 5], scores[0, 0, 0] = 0.9, 0.8, 0.7, 0.6
    found = decode_boxes(logits(scores), boxes_of(), GRID, min_score=0.5)
    assert found.scores == pytest.approx([0.9, 0.7, 0.6])
    assert len(decode_boxes(logits(scores), boxes_of(), GRID, 0.5, most=2)) == 2


def test_peaks_are_those_of_whole_planes():
    scores = np.random.default_rng(0).uniform(0.02, 0.98, (3, 32, 32)).round(2)  # many are equal
    found = decode_boxes(logits(scores), boxes_of(), GRID, min_score=0.3, most=3000)
    highest = maximum_filter(scores, size=(1, 3, 3), mode="constant")
    is_peak = (scores == highest) & (scores > 0.305)
    kept = found.scores > 0.305
    assert sorted(found.scores[kept]) == pytest.approx(sorted(scores[is_peak]))
    classes, rows, columns = is_peak.nonzero()
    expected = np.column_stack([classes, -6.4 + 0.4 * (rows + 1), -6.4 + 0.4 * (columns + 1)])
    places = np.column_stack([found.classes, found.boxes.bottom_m[:, :2]])[kept]
    assert sorted(map(tuple, places.round(3))) == sorted(map(tuple, expected.round(3)))


def person(row_offset, column_offset):
    size = np.log([0.6, 0.6, 1.7])
    return [row_offset, column_offset, 0.0, *size, 0, 1, 0, 1, *np.zeros(6)]


def test_two_people_side_by_side_are_two_where_each_place_states_its_own_centre():
    scores = np.full((1, 32, 32), 0.01)
    scores[0, 10, 10:13] = 0.6, 0.5, 0.3
    beside = (
        ((10, 10), person(0.5, 0.2)),
        ((10, 11), person(0.5, 0.7)),
        ((10, 12), person(0.5, -0.3)),
    )
    found = decode_boxes(logits(scores), boxes_of(*beside), GRID)
    assert found.scores == pytest.approx([0.6, 0.5])
    assert np.diff(found.boxes.bottom_m[:, 1]) == pytest.approx([0.6])
    assert len(suppress(found, (0,))) == 2
    nearer = (beside[0], ((10, 11), person(0.5, 0.1)), beside[2])
    assert len(suppress(decode_boxes(logits(scores), boxes_of(*nearer), GRID), (0,))) == 1
    wide = [(place, [*stated[:4], np.log(0.81), *stated[5:]]) for place, stated in beside]
    assert decode_boxes(logits(scores), boxes_of(*wide), GRID).scores == pytest.approx([0.6])


def test_no_box_is_detected_where_no_score_is_high():
    found = decode_boxes(logits(np.full((2, 32, 32), 0.01)), boxes_of(), GRID)
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
