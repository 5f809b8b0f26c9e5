"""Detections of all modalities merged without a network."""

import numpy as np

from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.nms_fusion import NmsFusion
from perception.types import Detections


def detections(*rows, types=None):
    boxes_px = np.array([row[:4] for row in rows], float).reshape(-1, 4)
    return Detections(
        boxes_px,
        np.array([row[4] for row in rows]),
        np.array(types or ["Car"] * len(rows), np.str_),
    )


def test_union_keeps_the_best_of_each_place_and_says_who_else_saw_it():
    modality_detections = {
        "rgb": detections((0, 0, 10, 10, 0.6), (50, 0, 60, 10, 0.5)),
        "dm": detections((0, 0, 10, 12, 0.9)),
        "rm": detections((100, 0, 110, 10, 0.7), (0, 0, 10, 11, 0.1)),
    }
    fused = NmsFusion().fuse(DetectedScene(modality_detections, (200, 100)))
    np.testing.assert_array_equal(fused.detections.scores, [0.9, 0.7, 0.5])
    np.testing.assert_array_equal(fused.source_indices, [[0, 0, 1], [-1, -1, 0], [1, -1, -1]])
    np.testing.assert_array_equal(fused.dominant_modality, [1, 2, 0])


def test_union_keeps_classes_apart():
    modality_detections = {
        "rgb": detections((0, 0, 10, 10, 0.6), types=["Van"]),
        "rm": detections((0, 0, 10, 10, 0.9)),
    }
    fused = NmsFusion().fuse(DetectedScene(modality_detections, (200, 100)))
    assert fused.detections.types.tolist() == ["Car", "Van"]
    np.testing.assert_array_equal(fused.source_indices, [[-1, -1, 0], [0, -1, -1]])


def test_union_of_no_detections():
    assert len(NmsFusion().fuse(DetectedScene({}, (200, 100)))) == 0
    assert len(NmsFusion().fuse(DetectedScene({"rgb": Detections.empty()}, (200, 100)))) == 0
