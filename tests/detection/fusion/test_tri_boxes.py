"""Combinations of boxes: by hand, beside plain loops, and in a crowd."""

import numpy as np
import pytest

from perception.detection.config import TRI_BOX_CONFIGS, TriBoxConfig
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.tri_boxes import tri_boxes
from tests.detection.fusion.scenes import SIZE_PX, clumped_scene, detections
from tests.reference.fusion import reference_tri_boxes

CONFIGS_TO_TRY = [
    TriBoxConfig(),
    TriBoxConfig(max_partners=2),
    TriBoxConfig(max_partners=0),
    TriBoxConfig(min_iou=0.3, by_set=False, max_partners=1),
    TriBoxConfig(min_iou=0.1, by_set=False, max_partners=3),
]


def scene_of_boxes(rgb=(), dm=(), rm=()) -> DetectedScene:
    return DetectedScene(
        {"rgb": detections(rgb), "dm": detections(dm), "rm": detections(rm)}, SIZE_PX
    )


def test_the_example_of_the_drawing():
    scene = scene_of_boxes(
        rgb=[[100, 100, 200, 200]],
        dm=[[110, 100, 210, 200], [90, 100, 190, 200]],
        rm=[[500, 100, 600, 200]],
    )
    assert tri_boxes(scene).tolist() == [[-1, -1, 0], [0, 0, -1], [0, 1, -1]]


def test_a_set_is_what_overlaps_by_way_of_others():
    scene = scene_of_boxes(rgb=[[0, 0, 100, 100]], dm=[[90, 0, 190, 100]], rm=[[180, 0, 280, 100]])
    assert tri_boxes(scene).tolist() == [[0, 0, 0]]
    only_overlapping = TriBoxConfig(by_set=False)
    assert tri_boxes(scene, only_overlapping).tolist() == [[-1, 0, 0], [0, 0, -1], [0, 0, 0]]


def test_boxes_of_other_types_show_other_objects():
    box = [[0, 0, 100, 100]]
    modality_detections = {"rgb": detections(box), "dm": detections(box, type_="Pedestrian")}
    assert tri_boxes(DetectedScene(modality_detections, SIZE_PX)).tolist() == [
        [-1, 0, -1],
        [0, -1, -1],
    ]


def test_without_boxes_there_is_no_combination():
    assert tri_boxes(DetectedScene({}, SIZE_PX)).shape == (0, 3)
    assert tri_boxes(scene_of_boxes()).shape == (0, 3)


@pytest.mark.parametrize("rules", CONFIGS_TO_TRY)
@pytest.mark.parametrize("seed", range(4))
def test_equals_the_reference(rules, seed):
    scene = clumped_scene(seed)
    np.testing.assert_array_equal(tri_boxes(scene, rules), reference_tri_boxes(scene, rules))


def test_a_modality_that_is_missing_has_no_box_anywhere():
    scene = clumped_scene(1).without("dm")
    rows = tri_boxes(scene)
    assert (rows[:, 1] == -1).all()
    np.testing.assert_array_equal(rows, reference_tri_boxes(scene, TriBoxConfig()))


@pytest.mark.parametrize("rules", TRI_BOX_CONFIGS.values())
def test_a_crowd_is_bounded_and_keeps_every_box_and_its_best_partners(rules):
    scene = clumped_scene(0, clumps=2, most=40)
    boxes = len(scene.merged.detections)
    rows = tri_boxes(scene, rules)
    assert len(rows) <= boxes * rules.max_partners**2
    assert len(rows) < np.prod([len(found) for found in scene.modality_detections.values()])
    for column, found in enumerate(scene.modality_detections.values()):
        assert set(range(len(found))) <= set(rows[:, column].tolist())
    best = reference_tri_boxes(scene, TriBoxConfig(rules.min_iou, rules.by_set, 1))
    assert set(map(tuple, best.tolist())) <= set(map(tuple, rows.tolist()))
