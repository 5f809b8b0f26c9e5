"""Who is a vehicle, who is none, and who is left out."""

from dataclasses import replace

import numpy as np

from data.samples.crops.labelled_frames import ProposalScene
from data.samples.crops.sampling import match_by_boxes, match_by_points

SCENE = ProposalScene(
    boxes_px=np.zeros((0, 4)),
    depths_m=np.zeros(0),
    shares=np.zeros((0, 3)),
    label_types=np.array(["Car", "Van", "Pedestrian"]),
    label_boxes_px=np.array([[0.0, 0, 100, 100], [200, 0, 300, 100], [400, 0, 430, 100]]),
    label_depths_m=np.full(3, 20.0),
    label_points=np.full(3, 50),
    dont_care_px=np.array([[500.0, 0, 600, 100]]),
    focal_px=700.0,
)


def test_half_of_the_points_within_a_car_make_a_vehicle():
    shares = [[0.5, 0, 0], [0.49, 0, 0], [0.1, 0, 0], [0, 0.9, 0], [0, 0, 1.0], [0.4, 0.6, 0]]
    boxes = np.tile([700.0, 0, 750, 50], (6, 1))
    matches = match_by_points(replace(SCENE, shares=np.array(shares), boxes_px=boxes), ("Car",))
    assert matches.labels.tolist() == [0, -1, -1, -1, -1, -1]
    assert matches.is_left_out.tolist() == [False, True, False, True, False, True]


def test_the_overlap_of_boxes_makes_a_vehicle_for_the_thesis():
    boxes = np.array(
        [
            [0.0, 0, 100, 50],  # half of the car
            [0, 0, 100, 40],
            [0, 0, 100, 29],
            [200, 0, 300, 90],  # the van
            [400, 0, 430, 100],  # the pedestrian
            [700, 0, 750, 50],
        ]
    )
    matches = match_by_boxes(replace(SCENE, shares=np.zeros((6, 3)), boxes_px=boxes), ("Car",))
    assert matches.labels.tolist() == [0, -1, -1, -1, -1, -1]
    assert matches.is_left_out.tolist() == [False, True, False, True, False, False]


def test_proposals_outside_the_labelled_view_are_left_out():
    boxes = np.array([[510.0, 10, 560, 60], [450, 0, 560, 50]])
    matches = match_by_points(replace(SCENE, shares=np.zeros((2, 3)), boxes_px=boxes), ("Car",))
    assert matches.is_left_out.tolist() == [True, True]
    mostly_outside = np.array([[400.0, 0, 560, 50]])
    matches = match_by_points(
        replace(SCENE, shares=np.zeros((1, 3)), boxes_px=mostly_outside), ("Car",)
    )
    assert matches.is_left_out.tolist() == [False]


def test_of_two_cars_the_closer_is_the_label():
    scene = replace(
        SCENE,
        label_types=np.array(["Car", "Car", "Car"]),
        shares=np.array([[0.0, 0.3, 0.7]]),
        boxes_px=np.array([[700.0, 0, 750, 50]]),
    )
    assert match_by_points(scene, ("Car",)).labels.tolist() == [2]


def test_without_labels_all_are_none_and_without_proposals_there_are_none():
    empty = replace(
        SCENE,
        label_types=np.zeros(0, np.str_),
        label_boxes_px=np.zeros((0, 4)),
        dont_care_px=np.zeros((0, 4)),
    )
    boxes = np.array([[0.0, 0, 50, 50]])
    for match in (match_by_points, match_by_boxes):
        scene = replace(empty, shares=np.zeros((1, 0)), boxes_px=boxes)
        matches = match(scene, ("Car",))
        assert (matches.labels.tolist(), matches.is_left_out.tolist()) == ([-1], [False])
        assert len(match(SCENE, ("Car",)).labels) == 0


def test_objects_of_several_classes_are_matched_and_neighbours_of_none_left():
    shares = np.array([[0.9, 0, 0], [0, 0.9, 0], [0, 0, 0.9], [0, 0.05, 0]])
    scene = replace(SCENE, shares=shares, boxes_px=np.tile([700.0, 0, 750, 50], (4, 1)))
    matches = match_by_points(scene, ("Car", "Van", "Pedestrian"))
    assert matches.labels.tolist() == [0, 1, 2, -1]
    assert matches.is_left_out.tolist() == [False] * 4
    alone = match_by_points(scene, ("Car", "Pedestrian"))
    assert alone.labels.tolist() == [0, -1, 2, -1]
    assert alone.is_left_out.tolist() == [False, True, False, False]
