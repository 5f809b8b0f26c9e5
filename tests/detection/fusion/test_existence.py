"""How likely an object is by the score of its box."""

import numpy as np
import pytest

from perception.detection.fusion.existence import existence_of
from perception.detection.fusion.nms_fusion import NmsFusion
from tests.detection.fusion.scenes import clumped_scene


@pytest.mark.parametrize(
    ("searched", "name", "expected"),
    [
        ("rgb+dm+rm", "Car", [0.622, 0.292]),  # log-odds of 0 and -1.39, and 0.5 more
        ("rgb", "Van", [0.622, 0.292]),
        ("dm+rm", "Car", [0.769, 0.454]),  # 1.2 more
        ("dm", "Truck", [0.769, 0.454]),
        ("dm+rm", "Pedestrian", [0.622, 0.292]),
        ("rm", "Cyclist", [0.622, 0.292]),
    ],
)
def test_existence_is_likelier_than_a_score_says_by_more_for_vehicles_in_maps_alone(
    searched, name, expected
):
    found = existence_of(np.array([0.5, 0.2]), np.array([searched] * 2), np.array([name] * 2))
    np.testing.assert_allclose(found, expected, atol=1e-3)


def test_scores_of_0_and_1_stay_probabilities_in_their_order():
    found = existence_of(np.array([0.0, 0.5, 1.0]), np.array(["dm"] * 3), np.array(["Car"] * 3))
    assert (np.diff(found) > 0).all()
    np.testing.assert_allclose(found[[0, 2]], [0.0, 1.0], atol=1e-5)


def test_without_a_network_existence_is_that_of_the_kept_boxes():
    scene = clumped_scene(0)
    fused = NmsFusion().fuse(scene)
    names = scene.set_names(fused.detections.types)
    expected = existence_of(fused.detections.scores, names, fused.detections.types)
    np.testing.assert_array_equal(fused.existence, expected)
    assert (fused.existence > fused.detections.scores).all()
