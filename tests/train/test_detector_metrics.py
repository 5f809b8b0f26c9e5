"""KITTI's measure of what all processes have seen."""

import numpy as np
import pytest
import torch

from perception.detection.detectors.network_input import PixelRectangle, place
from perception.evaluation.detection.protocol import KITTI_CLASSES
from perception.types import Detections
from tests.train.toy_images import SCALE, SIZE, ToySamples
from train.detector.metrics import (
    ValidationBoxes,
    kitti_class,
    mean_precision,
    measure,
    precision_table,
)

NAMES = ("Car", "Pedestrian")


def detections(*rows):
    boxes_px = np.array([row[:4] for row in rows], np.float64).reshape(-1, 4)
    return Detections(
        boxes_px, np.array([row[4] for row in rows]), np.array([row[5] for row in rows], np.str_)
    )


def placements(*sizes_px):
    return [place(PixelRectangle(0, 0, *size_px), SIZE, "stretch") for size_px in sizes_px]


def test_boxes_are_gathered_in_pixels_of_the_images():
    boxes = ValidationBoxes(NAMES)
    seen = [detections((8, 4, 16, 12, 0.5, "Pedestrian")), detections((0, 0, 96, 64, 0.75, "Car"))]
    boxes.update(seen, torch.tensor([2, 0]), process=0)
    found = boxes.gathered(placements((192, 128), (96, 64), (384, 64)))
    assert found.frames.tolist() == [0, 2]
    assert found.types.tolist() == ["Car", "Pedestrian"]
    np.testing.assert_allclose(found.boxes_px, [[0, 0, 192, 128], [32, 4, 64, 12]])
    np.testing.assert_allclose(found.scores, [0.75, 0.5])


def test_an_image_of_two_processes_counts_once():
    boxes, one = ValidationBoxes(NAMES), detections((0, 0, 40, 40, 0.5, "Car"))
    boxes.update([one], torch.tensor([0]), process=1)
    boxes.update([one], torch.tensor([1]), process=1)
    boxes.update([one], torch.tensor([0]), process=0)
    found = boxes.gathered(placements((96, 64), (96, 64)))
    assert found.frames.tolist() == [0, 1]


def test_no_detection_is_an_average_precision_of_zero():
    samples, boxes = ToySamples(3, 0), ValidationBoxes(NAMES)
    boxes.update([detections()], torch.tensor([1]), process=0)
    found = boxes.gathered(placements(*[(384, 256)] * 3))
    metrics = mean_precision(measure(samples.truth(), found, 3, NAMES))
    assert set(metrics.values()) == {0.0}


def perfect_but_shifted(samples, shift_px):
    boxes = ValidationBoxes(("Car",))
    for row in range(len(samples)):
        shifted_px = samples.boxes_px[row] + np.array([shift_px, 0, shift_px, 0])
        rows = [(*box_px, 0.9, "Car") for box_px in shifted_px]
        boxes.update([detections(*rows)], torch.tensor([row]), process=0)
    found = boxes.gathered([samples.placement(row) for row in range(len(samples))])
    return measure(samples.truth(), found, len(samples), ("Car",))


def test_boxes_somewhat_off_are_right_at_half_the_overlap_only():
    samples = ToySamples(11, 0)  # 44 cars, enough for all 41 points of recall
    assert set(mean_precision(perfect_but_shifted(samples, 0)).values()) == {100.0}
    metrics = mean_precision(perfect_but_shifted(samples, 5))
    assert metrics["moderate"] < 10
    assert metrics["moderate_50"] == 100
    assert SCALE * samples.label_sizes_px()[:, 1].min() > 40


def test_the_table_names_class_and_overlap():
    table = precision_table(perfect_but_shifted(ToySamples(11, 0), 0))
    assert table == {
        name: {"easy": 100.0, "moderate": 100.0, "hard": 100.0} for name in ("Car 0.7", "Car 0.5")
    }


@pytest.mark.parametrize(("name", "iou"), [("Car", 0.7), ("pedestrian", 0.5), ("Tram", 0.7)])
def test_classes_are_evaluated_as_kitti_does(name, iou):
    of_class = kitti_class(name)
    assert (of_class.name.lower(), of_class.iou) == (name.lower(), iou)
    assert (of_class in KITTI_CLASSES) == (name != "Tram")
