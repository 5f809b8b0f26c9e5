"""Which of a network's answers are objects."""

import numpy as np
import pytest

from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.postprocess import postprocess_detections
from perception.errors import UsageError

SIZE = InputSize(64, 96)
NAMES = ("Car", "Pedestrian")


def test_the_better_of_two_on_one_object_stays():
    boxes_px = np.array([[10, 10, 30, 30], [10, 10, 30, 31], [50, 10, 70, 30]], np.float32)
    scores = np.array([[0.4, 0.0], [0.6, 0.0], [0.5, 0.0]], np.float32)
    found = postprocess_detections(boxes_px, scores, NAMES, SIZE)
    np.testing.assert_allclose(found.boxes_px, boxes_px[[1, 2]])
    np.testing.assert_allclose(found.scores, [0.6, 0.5], rtol=1e-6)
    assert found.types.tolist() == ["Car", "Car"]


def test_classes_stand_beside_each_other():
    found = postprocess_detections(
        np.array([[10.0, 10, 30, 30]]), np.array([[0.3, 0.7]]), NAMES, SIZE
    )
    assert found.types.tolist() == ["Pedestrian", "Car"]


def test_boxes_end_at_the_edges_and_unsure_or_empty_ones_are_left_out():
    boxes_px = np.array([[-5.0, -5, 20, 70], [100, 10, 120, 20], [30, 30, 40, 40]])
    scores = np.array([[0.9, 0], [0.9, 0], [0.009, 0]])
    found = postprocess_detections(boxes_px, scores, NAMES, SIZE)
    np.testing.assert_allclose(found.boxes_px, [[0, 0, 20, 64]])


def test_a_crowd_keeps_its_best():
    places = np.arange(400.0)
    corners = np.stack([places % 24 * 4, places // 24 * 3], axis=1)
    scores = np.linspace(0.9, 0.1, 400)[:, None] * [1.0, 0.0]
    found = postprocess_detections(np.hstack([corners, corners + 2]), scores, NAMES, SIZE)
    np.testing.assert_allclose(found.scores, scores[:64, 0])


def test_predictions_below_the_score_give_no_detection():
    assert len(postprocess_detections(np.zeros((0, 4)), np.zeros((0, 2)), NAMES, SIZE)) == 0
    assert (
        len(postprocess_detections(np.full((3, 4), np.nan), np.full((3, 2), 0.5), NAMES, SIZE)) == 0
    )


def test_a_size_is_height_by_width():
    assert InputSize.parse("192x640") == InputSize(height_px=192, width_px=640)


@pytest.mark.parametrize("text", ["192", "large", "190x640", "0x640", "192X640", "-32x64"])
def test_other_sizes(text):
    with pytest.raises(UsageError) as error:
        InputSize.parse(text)
    assert (error.value.where, error.value.found) == ("input size", text)
