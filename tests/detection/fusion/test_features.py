"""The 23 features by hand and beside plain loops, and what the richer set adds."""

import numpy as np
import pytest

from benchmarks.reference.fusion import reference_features
from perception.detection.fusion.detected_scene import DetectedScene, box_depths_m, scene_of
from perception.detection.fusion.features import FEATURES, tri_box_features
from perception.detection.fusion.tri_boxes import tri_boxes
from perception.maps.densify import DenseMaps
from perception.types import Calibration
from tests.detection.fusion.scenes import clumped_scene, detections


def maps_of(depth_m) -> DenseMaps:
    depth_m = np.asarray(depth_m, np.float32)
    return DenseMaps(depth_m, np.zeros_like(depth_m), depth_m > 0, np.zeros(depth_m.shape, bool))


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
        found, np.hstack([expected[:, :3], [[1, 0, 0, 0, 0]] * len(rows)])
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


def test_where_nobody_says_a_camera_is_a_usual_one():
    plain = clumped_scene(3)
    assert plain.focal_px == pytest.approx(621 / np.tan(np.deg2rad(40)))
    matrix = np.array([[720.0, 0, 600, 45], [0, 710, 170, 0], [0, 0, 1, 0]])
    known = scene_of(plain.modality_detections, plain.size_px, None, Calibration(matrix, np.eye(4)))
    assert known.focal_px == known.without("rgb").focal_px == 710


def test_depths_are_those_that_are_known():
    depth_m = np.zeros((40, 60))
    depth_m[:20, :10], depth_m[:20, 10:20] = 5, 30
    dense = maps_of(depth_m)
    boxes_px = np.array([[0.0, 0, 20, 20], [10, 0, 20, 40], [30, 0, 60, 40], [-50, -50, 5, 5]])
    near_middle = box_depths_m(boxes_px, dense)
    np.testing.assert_array_equal(near_middle, [[5, 5], [30, 30], [np.nan] * 2, [5, 5]])
    assert box_depths_m(np.zeros((0, 4)), dense).shape == (0, 2)


def test_a_fifth_of_nearer_points_is_the_near_side():
    depth_m = np.full((20, 20), 12.0)
    depth_m[:, :4] = 8
    found = box_depths_m(np.array([[0.0, 0, 20, 20]]), maps_of(depth_m))
    np.testing.assert_array_equal(found, [[8, 12]])


def test_without_the_maps_nothing_is_known_of_depth():
    dense = maps_of(np.full((375, 1242), 10.0))
    scene = clumped_scene(0)
    full = scene_of(scene.modality_detections, scene.size_px, dense)
    assert set(full.depths_m) == {"rgb", "dm", "rm"}
    assert full.without("dm").depths_m.keys() == {"rgb", "rm"}
    assert full.without("dm", "rm").depths_m == {}
    assert np.isnan(full.without("dm", "rm").merged_depths_m).all()
