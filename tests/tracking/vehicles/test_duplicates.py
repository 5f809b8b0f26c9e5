"""Each object is shown once: the row of its track, whatever its other classes and other cameras say."""

from dataclasses import replace

import numpy as np
import pytest

from perception.tracking.vehicles.duplicates import distinct_rows
from perception.types import BoxDeviations, Boxes3D, Detections, FusedDetections, Vehicles

AT = np.array([[20.0, 2.0, -1.7], [21.0, 2.0, -1.7], [20.0, -6.0, -1.7]])
IN_IMAGE = np.array([[500.0, 150, 600, 240], [505, 152, 598, 238], [800, 150, 900, 240]])


def vehicles(ids, scores, cameras=(0, 0, 0), **values) -> Vehicles:
    count = len(ids)
    found = Detections(IN_IMAGE, np.array(scores), np.array(["Truck", "Van", "Car"]))
    fused = FusedDetections(
        found, np.full((count, 3), -1), np.zeros(count, np.int64), np.array(scores)
    )
    table = Vehicles(
        fused=fused, ids=np.array(ids), boxes=Boxes3D(AT, np.tile([5.0, 2, 2], (count, 1)), np.zeros(count)),
        distances_m=np.full(count, 20.0), velocities_m_s=np.zeros((count, 2)),
        covariances=np.zeros((count, 4, 4)), box_deviations=BoxDeviations.unknown(count),
        owners=np.array([0]), cameras=np.array(cameras),
    )  # fmt: skip
    return replace(table, **values)


@pytest.mark.parametrize(
    ("ids", "scores", "shown"),
    [
        ((7, -1, -1), (0.6, 0.9, 0.8), [0, 2]),  # the track's class, though another scores higher
        ((-1, -1, -1), (0.6, 0.9, 0.8), [1, 2]),
        ((7, 8, -1), (0.6, 0.9, 0.8), [0, 1, 2]),  # two tracks are two objects
        ((7, -1, -1), (0.4, 0.9, 0.8), [1, 2]),  # what is below the score is no object
        ((-1, -1, -1), (0.4, 0.3, 0.2), []),
    ],
)
def test_of_several_classes_one_is_shown(ids, scores, shown):
    assert distinct_rows(vehicles(ids, scores), 0.5).tolist() == shown


def test_returns_tell_a_car_from_the_one_behind_it():
    behind = AT + np.array([[0, 0, 0], [12.0, 0, 0], [0, 0, 0]])
    both = vehicles((7, -1, -1), (0.9, 0.9, 0.9))
    apart = replace(both, boxes=replace(both.boxes, bottom_m=behind))
    assert distinct_rows(apart, 0.5).tolist() == [0, 1, 2]
    unlocated = replace(both.boxes, yaw_rad=np.array([0.0, np.nan, 0.0]))
    assert distinct_rows(replace(both, boxes=unlocated), 0.5).tolist() == [0, 2]


def test_an_object_at_the_border_of_two_images_is_shown_once():
    parts = vehicles((7, -1, -1), (0.6, 0.9, 0.8), cameras=(0, 1, 1))
    assert distinct_rows(parts, 0.5).tolist() == [0, 2]
