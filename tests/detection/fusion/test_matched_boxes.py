"""Matches by hand, and beside all ways to match."""

from itertools import permutations

import numpy as np
import pytest

from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.matched_boxes import blended_boxes_px, box_weights, matched_boxes
from perception.types import MODALITIES
from tests.detection.fusion.scenes import SIZE_PX, clumped_scene, detections


def test_a_box_is_matched_with_one_of_each_modality():
    scene = DetectedScene(
        {
            "rgb": detections([[100, 100, 200, 200]]),
            "dm": detections([[130, 100, 230, 200], [110, 100, 210, 200]]),
            "rm": detections([[115, 100, 215, 200], [600, 100, 700, 200]]),
        },
        SIZE_PX,
    )
    found = matched_boxes(scene, 0.4)
    assert found.tolist() == [[0, 1, 0], [-1, 0, -1], [-1, -1, 1]]


def test_boxes_of_two_classes_or_far_apart_are_not_matched():
    van = detections([[100, 100, 200, 200]], type_="Van")
    scene = DetectedScene(
        {
            "rgb": detections([[100, 100, 200, 200]]),
            "dm": van,
            "rm": detections([[145, 100, 245, 200]]),  # overlaps by 0.38
        },
        SIZE_PX,
    )
    assert matched_boxes(scene, 0.4).tolist() == [[0, -1, -1], [-1, 0, -1], [-1, -1, 0]]
    assert matched_boxes(scene, 0.3).tolist() == [[0, -1, 0], [-1, 0, -1]]


@pytest.mark.parametrize("seed", range(6))
def test_the_sum_of_overlaps_is_that_of_the_best_of_all_matches(seed):
    scene = clumped_scene(seed, clumps=2).without("rm")
    rows = matched_boxes(scene, 0.2)
    counts = [len(scene.modality_detections[name]) for name in ("rgb", "dm")]
    iou = np.where(scene.merged.iou > 0.2, scene.merged.iou, 0)[: counts[0], counts[0] :]
    if counts[0] > counts[1]:
        iou = iou.T
    best = max(
        iou[np.arange(len(iou)), list(order)].sum()
        for order in permutations(range(iou.shape[1]), len(iou))
    )
    places = scene.merged.places(rows[(rows[:, :2] >= 0).all(axis=1)])
    assert scene.merged.iou[places[:, 0], places[:, 1]].sum() == pytest.approx(best)
    for column, name in enumerate(MODALITIES):
        own = rows[rows[:, column] >= 0, column]
        assert sorted(own) == list(range(len(scene.modality_detections.get(name, ()))))


def test_boxes_of_higher_scores_and_of_the_camera_weigh_more():
    scene = DetectedScene(
        {
            "rgb": detections([[100, 100, 200, 200], [600, 100, 700, 200]], [0.5, 0.9]),
            "dm": detections([[110, 100, 210, 200], [620, 100, 720, 200]], [0.5, 0.5]),
        },
        SIZE_PX,
    )
    rows = matched_boxes(scene, 0.4)
    np.testing.assert_allclose(box_weights(scene, rows)[0], [1 / 1.7, 0.7 / 1.7, 0])
    np.testing.assert_allclose(box_weights(scene, rows)[1], [100 / 102.8, 2.8 / 102.8, 0])
    left_px = blended_boxes_px(scene, rows)[:, 0]
    np.testing.assert_allclose(left_px, [100 + 7 / 1.7, 600 + 20 * 2.8 / 102.8])
