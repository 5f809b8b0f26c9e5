"""The 23 features by hand and beside plain loops, and what the richer set adds."""

import numpy as np
import pytest

from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.features import FEATURES, tri_box_features
from perception.detection.fusion.tri_boxes import tri_boxes
from tests.detection.fusion.scenes import clumped_scene, detections
from tests.reference.fusion import reference_features


def named(scene, rows, variant="default"):
    values = tri_box_features(scene, np.array(rows), variant)
    return dict(zip(FEATURES[variant], values.T.tolist(), strict=True))


def test_two_boxes_of_three_by_hand():
    modality_detections = {
        "rgb": detections([[0, 0, 20, 10]], [0.9]),
        "rm": detections([[10, 0, 50, 30]], [0.5]),
    }
    scene = DetectedScene(modality_detections, (100, 50))
    printed = tri_box_features(scene, np.array([[0, -1, 0]]), "features")[0]
    scores = [0.9, 0, 0.5]
    boxes = [0.2, 0.2, 0.1, 0.1, *[0.0] * 4, 0.4, 0.6, 0.3, 0.3]
    spread = [0.2, 0.2, 0.1, 0.1]
    around = [0.5, 0.6, 0.25, 0.3]
    np.testing.assert_allclose(printed, [*scores, *boxes, *spread, *around], atol=1e-12)


def test_there_are_as_many_as_printed():
    assert [len(FEATURES[variant]) for variant in ("scores", "features")] == [3, 23]
    scene = clumped_scene(0)
    for variant, names in FEATURES.items():
        assert tri_box_features(scene, tri_boxes(scene), variant).shape[1] == len(names)


@pytest.mark.parametrize("seed", range(4))
def test_equals_the_reference(seed):
    scene = clumped_scene(seed)
    rows = tri_boxes(scene)
    expected = reference_features(scene, rows)
    np.testing.assert_allclose(tri_box_features(scene, rows, "features"), expected, atol=1e-12)
    np.testing.assert_array_equal(tri_box_features(scene, rows, "scores"), expected[:, :3])
    found = tri_box_features(scene, rows, "default")
    np.testing.assert_array_equal(
        found, np.hstack([expected[:, :3], [[1, 1, 1, 1, 0, 0, 0, 0]] * len(rows)])
    )


@pytest.mark.parametrize("variant", FEATURES)
def test_no_combination_has_no_features(variant):
    found = tri_box_features(clumped_scene(0), np.zeros((0, 3), int), variant)
    assert found.shape == (0, len(FEATURES[variant]))


def test_classes_are_flags_beside_the_scores():
    modality_detections = {
        "rgb": detections([[0, 0, 20, 10]], [0.9], "Van"),
        "dm": detections([[0, 0, 20, 11]], [0.6]).joined(detections([[0, 0, 20, 9]], [0.2], "Bus")),
        "rm": detections([[11, 0, 31, 10]], [0.7]),
    }
    scene = DetectedScene(modality_detections, (100, 50))
    found = named(scene, [[0, -1, -1], [-1, 0, 0], [-1, 1, -1]])
    assert found["score_rgb"] == [0.9, 0, 0]
    assert found["score_rm"] == [0, 0.7, 0]
    assert found["is_car"] == [0, 1, 0]
    assert found["is_van"] == [1, 0, 0]
    assert found["is_truck"] == [0, 0, 0]
