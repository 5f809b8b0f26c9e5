"""From the outputs of each form to boxes and scores.

K boxes, S classes of the network, C classes that are reported. All become (K, 4) boxes x1 y1 x2 y2 in pixels of the
input, and (K, C) scores. Of a batch the first image counts.
"""

from typing import NamedTuple

import numpy as np

from perception.detection.detectors.class_columns import ClassColumns
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.network_outputs import Outputs, cells_px, of_first_image, tables
from perception.types import Float, Float32

_MAX_LOG_SIZE = 20.0  # beyond it no box is an image's


class Predictions(NamedTuple):
    """K boxes with C scores each."""

    boxes_px: Float
    scores: Float32


def decode_trifuse(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    """Return boxes and scores as they are."""
    return Predictions(outputs["boxes_px"][0], classes.of_scores(outputs["scores"][0]))


def decode_labels(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    """Return boxes with one class each, of a suppression as many as it counts."""
    boxes_px = of_first_image(outputs["boxes"], 2)
    scores, labels = (of_first_image(outputs[name], 1) for name in ("scores", "labels"))
    found = classes.of_labels(np.rint(labels), scores.astype(np.float32, copy=False))
    if len(found) != len(boxes_px):
        raise ValueError("not as many boxes as scores")
    count = int(outputs["count"].flat[0]) if "count" in outputs else len(found)
    return Predictions(boxes_px[:count], found[:count])


def decode_tensorflow(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    """Return the boxes of TensorFlow's suppression: y1 x1 y2 x2 from 0 to 1."""
    boxes, scores = decode_labels(outputs, size, classes)
    return Predictions(boxes[:, [1, 0, 3, 2]] * _sides_px(size), scores)


def decode_softmax(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    """Return boxes by logits of classes that exclude each other, no object the last one."""
    from scipy.special import softmax

    scores = softmax(of_first_image(outputs["logits"], 2).astype(np.float32), axis=-1)
    return Predictions(_unit_boxes(outputs["pred_boxes"], size), classes.of_scores(scores))


def decode_sigmoid(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    """Return boxes by logits of classes one by one."""
    from scipy.special import expit

    logits = outputs["logits"] if "logits" in outputs else outputs["labels"]
    scores = expit(classes.of_scores(of_first_image(logits, 2).astype(np.float32)))
    return Predictions(_unit_boxes(outputs["pred_boxes"], size), scores)


def decode_rows(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    """Return boxes by rows of x1 y1 x2 y2, score, class."""
    rows = _only(outputs)
    return Predictions(rows[:, :4], classes.of_labels(np.rint(rows[:, 5]), rows[:, 4]))


def decode_numbered_rows(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    """Return boxes by rows of image, x1 y1 x2 y2, class, score."""
    rows = _only(outputs)
    if rows.shape[1] != 7:
        raise ValueError("other columns than image, box, class and score")
    rows = rows[rows[:, 0] == 0]  # of the first image of the batch
    return Predictions(rows[:, 1:5], classes.of_labels(np.rint(rows[:, 5]), rows[:, 6]))


def decode_columns(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    """Return boxes by columns of center, size, scores."""
    rows = _only(outputs).T
    return Predictions(_corner_boxes(rows[:, :2], rows[:, 2:4]), classes.of_scores(rows[:, 4:]))


def decode_unit_rows(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    """Return boxes by rows of center and size from 0 to 1, scores."""
    rows = _only(outputs)
    return Predictions(_unit_boxes(rows[:, :4], size), classes.of_scores(rows[:, 4:]))


def decode_yolox(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    """Return boxes by rows of center and size relative to their cells, objectness, scores."""
    rows, cells = _only(outputs), cells_px(size)
    strides_px = cells[:, 2:]
    centers_px = (rows[:, :2] + cells[:, :2]) * strides_px
    sizes_px = np.exp(np.minimum(rows[:, 2:4], _MAX_LOG_SIZE)) * strides_px
    return Predictions(_corner_boxes(centers_px, sizes_px), _with_objectness(rows, classes))


def decode_yolo(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    """Return boxes by rows of center, size, objectness, scores."""
    rows = _only(outputs)
    return Predictions(_corner_boxes(rows[:, :2], rows[:, 2:4]), _with_objectness(rows, classes))


def _with_objectness(rows: Float32, classes: ClassColumns) -> Float32:
    return rows[:, 4:5] * classes.of_scores(rows[:, 5:])


def _only(outputs: Outputs) -> Float32:
    (array,) = tables(outputs)
    return of_first_image(array, 2).astype(np.float32, copy=False)


def _unit_boxes(boxes: Float32, size: InputSize) -> Float32:
    rows = of_first_image(boxes, 2)
    return _corner_boxes(rows[:, :2], rows[:, 2:4]) * _sides_px(size)


def _sides_px(size: InputSize) -> Float32:
    return np.array([size.width_px, size.height_px] * 2, np.float32)


def _corner_boxes(centers: Float32, sizes: Float32) -> Float32:
    return np.hstack([centers - sizes / 2, centers + sizes / 2])
