"""Vehicles of known heights, called what a detector would call them."""

import numpy as np
import pytest

from perception.detection.vehicles.box_heights import classes_by_height
from perception.detection.vehicles.locate import locate
from perception.types import Detections
from tests.vehicle_scenes import FlatRoad, cars, detected, frame_of, road, sides


def classes_of(types, scores, heights_m, leaders) -> list[str]:
    found = Detections(np.zeros((len(types), 4)), np.array(scores), np.array(types))
    known = np.array(heights_m, float), np.array(leaders)
    return classes_by_height(found, *known).tolist()


@pytest.mark.parametrize(
    ("height_m", "expected"), [(1.5, "Car"), (2.1, "Van"), (3.4, "Truck"), (np.nan, "Car")]
)
def test_height_tells_vehicles_apart(height_m, expected):
    assert classes_of(["Car"], [0.9], [height_m], [0]) == [expected]


def test_two_classes_at_one_place_change_places():
    found = classes_of(["Van", "Car", "Car"], [0.2, 0.8, 0.9], [2.1, 2.1, 1.5], [1, 1, 2])
    assert found == ["Car", "Van", "Car"]


def test_a_vehicle_whose_top_is_hidden_is_none_of_a_lower_class():
    assert classes_of(["Van"], [0.9], [1.5], [0]) == ["Van"]


def test_people_stay_people_and_no_vehicles_stay_none():
    assert classes_of(["Pedestrian"], [0.9], [2.1], [0]) == ["Pedestrian"]
    assert classes_of([], [], [], []) == []


def test_what_is_taken_for_a_car_has_the_box_of_a_van():
    true = cars((15.0, -4.0, 0.0), size_m=(5.1, 1.9, 2.2))
    found = locate(detected(true), frame_of(road(), sides(true)), FlatRoad())
    assert found.fused.detections.types.tolist() == ["Van"]
    np.testing.assert_allclose(found.boxes.bottom_m, true.bottom_m, atol=0.3)
    np.testing.assert_allclose(found.boxes.size_m, true.size_m, atol=0.3)
