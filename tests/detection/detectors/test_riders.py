"""Persons and bicycles of public networks, and the cyclists that they are together."""

import numpy as np
import pytest

from perception.detection.detectors.modality_detector import join_riders
from perception.types import Detections

RIDERS = {"Cyclist": "Pedestrian"}
RIDER, BICYCLE = [100.0, 50, 130, 120], [95.0, 85, 140, 140]
WALKER, PARKED = [300.0, 50, 330, 140], [400.0, 90, 460, 140]


def found(*rows: tuple[str, list[float], float]) -> Detections:
    types, boxes_px, scores = zip(*rows, strict=True)
    return Detections(np.array(boxes_px), np.array(scores), np.array(types))


def test_a_person_on_a_bicycle_is_one_cyclist_and_a_parked_bicycle_none():
    detections = found(
        ("Pedestrian", RIDER, 0.9),
        ("Pedestrian", WALKER, 0.8),
        ("Car", [0.0, 0, 50, 50], 0.7),
        ("Cyclist", BICYCLE, 0.4),
        ("Cyclist", PARKED, 0.3),
    )
    joined = join_riders(detections, RIDERS)
    assert joined.types.tolist() == ["Pedestrian", "Car", "Cyclist", "Pedestrian"]
    np.testing.assert_allclose(joined.scores, [0.8, 0.7, 0.6, 0.9 * 0.6])
    np.testing.assert_allclose(joined.boxes_px[2], [95, 50, 140, 140])


@pytest.mark.parametrize(
    "person",
    [
        WALKER,
        [100.0, 50, 130, 160],  # stands before the bicycle
        [100.0, 90, 130, 130],  # lower than its handlebar
        [100.0, 20, 130, 80],  # behind it, on a wall
        [135.0, 50, 175, 120],  # beside it
        [100.0, -90, 130, 120],  # much nearer
    ],
)
def test_persons_away_from_a_bicycle_are_no_riders(person):
    joined = join_riders(found(("Pedestrian", person, 0.9), ("Cyclist", BICYCLE, 0.4)), RIDERS)
    assert joined.types.tolist() == ["Pedestrian"]
    assert joined.scores.tolist() == [0.9]


def test_each_bicycle_has_one_rider():
    detections = found(
        ("Pedestrian", RIDER, 0.9), ("Cyclist", BICYCLE, 0.8), ("Pedestrian", RIDER, 0.3)
    )
    joined = join_riders(detections, RIDERS)
    assert joined.types.tolist() == ["Cyclist", "Pedestrian", "Pedestrian"]
    np.testing.assert_allclose(joined.scores, [np.sqrt(0.72), 0.3, 0.18])


def test_classes_without_riders_stay_as_they_are():
    detections = found(("Pedestrian", RIDER, 0.9), ("Cyclist", BICYCLE, 0.4))
    assert join_riders(detections, {}) is detections
    assert len(join_riders(Detections.empty(), RIDERS)) == 0
