"""Forms of the outputs of public detectors, which are told apart by the names and shapes of their outputs.

K boxes, S classes of the network, C classes that are reported. All become (K, 4) boxes x1 y1 x2 y2 in pixels of the
input, and (K, C) scores:

    trifuse                 boxes_px (1, K, 4), scores (1, K, C)
    detr                    labels, boxes, scores (1, K), beside the input `orig_target_sizes`: DEIM, D-FINE, RT-DETR
    torchvision             boxes, labels, scores (K,), boxes in pixels, classes by COCO's numbers
    ultralytics-end-to-end  (1, K, 6): x1 y1 x2 y2, score, class
    ultralytics             (1, 4 + S, K): center and size, scores
    yolox                   (1, K, 5 + S): center and size relative to cells of 8, 16 and 32 pixels, objectness, scores
    yolo                    (1, K, 5 + S): center and size in pixels, objectness, scores: YOLOX decoded, YOLOv5, YOLOv7
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple, get_args

import numpy as np

from perception.detection.detectors.class_columns import COCO_CLASSES, COCO_NUMBERS, ClassColumns
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.network_input import Alignment, Resize
from perception.detection.onnx_model import Array
from perception.types import Float, Float32

OutputFormName = Literal[
    "trifuse", "detr", "torchvision", "ultralytics-end-to-end", "ultralytics", "yolox", "yolo"
]
OUTPUT_FORMS: tuple[OutputFormName, ...] = get_args(OutputFormName)
ColorOrder = Literal["RGB", "BGR"]
Outputs = Mapping[str, Array]

_STRIDES_PX = (8, 16, 32)
_MAX_LOG_SIZE = 20.0  # beyond it no box is an image's


class Predictions(NamedTuple):
    """K boxes with C scores each."""

    boxes_px: Float
    scores: Float32


@dataclass(frozen=True)
class InputFormat:
    """Pixels and geometry of a network's input: (scale * pixel - mean) / std.

    Attributes:
        color_order: Order of the three colours.
        scale: Factor of the pixels' values, 0 to 255.
        mean: Mean that is subtracted, of each colour in the network's order or one of all.
        std: Standard deviation that is divided by, of each colour or one of all.
        resize: Letterbox, stretch, or the whole image and tiles of it.
        alignment: Place of the image in a letterbox.
        pad_value: Pixel value of the padding, 0 to 255; None for 114, or 0 in maps.
    """

    color_order: ColorOrder = "RGB"
    scale: float = 1.0
    mean: tuple[float, ...] = (0.0,)
    std: tuple[float, ...] = (1.0,)
    resize: Resize = "letterbox"
    alignment: Alignment = "top-left"
    pad_value: int | None = None


@dataclass(frozen=True)
class OutputForm:
    """A form of outputs, and the input that networks of this form usually take.

    Attributes:
        decode: Function of outputs, input size and classes that returns the predictions.
        class_count: Function of the outputs that returns the number of the network's classes, None where they do not tell.
        input: Usual input.
        coco: Names of COCO's classes by their numbers in this form.
    """

    decode: Callable[[Outputs, InputSize, ClassColumns], Predictions]
    class_count: Callable[[Outputs], int | None]
    input: InputFormat
    coco: Mapping[int, str]


def recognized_form(
    outputs: Outputs, inputs: frozenset[str], size: InputSize
) -> OutputFormName | None:
    """Return the form of a network's outputs, None for one that is not known.

    Args:
        outputs: Outputs of a run on one blank image.
        inputs: Names of the network's inputs.
        size: Size of the image.
    """
    if {"boxes_px", "scores"} <= outputs.keys():
        return "trifuse"
    if {"labels", "boxes", "scores"} <= outputs.keys():
        return "detr" if "orig_target_sizes" in inputs else "torchvision"
    shapes = [array.shape for array in outputs.values()]
    if len(shapes) != 1 or len(shapes[0]) != 3:
        return None
    _, rows, columns = shapes[0]
    cells = sum((size.height_px // px) * (size.width_px // px) for px in _STRIDES_PX)
    if columns > 5 and rows % cells == 0:
        return "yolox" if rows == cells else "yolo"
    if columns == 6:
        return "ultralytics-end-to-end"
    return "ultralytics" if columns % cells == 0 and rows > 4 else None


def _decode_trifuse(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    return Predictions(outputs["boxes_px"][0], classes.of_scores(outputs["scores"][0]))


def _decode_labels(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    scores = outputs["scores"].reshape(-1)
    labels = outputs["labels"].reshape(-1)
    return Predictions(outputs["boxes"].reshape(-1, 4), classes.of_labels(labels, scores))


def _decode_end_to_end(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    rows = _only(outputs)
    return Predictions(rows[:, :4], classes.of_labels(np.rint(rows[:, 5]), rows[:, 4]))


def _decode_ultralytics(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    rows = _only(outputs).T
    return Predictions(_corner_boxes(rows[:, :2], rows[:, 2:4]), classes.of_scores(rows[:, 4:]))


def _decode_yolox(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    rows, cells = _only(outputs), _cells(size)
    strides_px = cells[:, 2:]
    centers_px = (rows[:, :2] + cells[:, :2]) * strides_px
    sizes_px = np.exp(np.minimum(rows[:, 2:4], _MAX_LOG_SIZE)) * strides_px
    return Predictions(_corner_boxes(centers_px, sizes_px), _with_objectness(rows, classes))


def _decode_yolo(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    rows = _only(outputs)
    return Predictions(_corner_boxes(rows[:, :2], rows[:, 2:4]), _with_objectness(rows, classes))


def _with_objectness(rows: Float32, classes: ClassColumns) -> Float32:
    return rows[:, 4:5] * classes.of_scores(rows[:, 5:])


def _only(outputs: Outputs) -> Float32:
    (array,) = outputs.values()
    return np.asarray(array[0], np.float32)


def _corner_boxes(centers_px: Float32, sizes_px: Float32) -> Float32:
    return np.hstack([centers_px - sizes_px / 2, centers_px + sizes_px / 2])


@lru_cache(maxsize=8)
def _cells(size: InputSize) -> Float32:
    """Return column, row and size of each cell of an input, the smallest first, row after row."""
    parts = []
    for stride in _STRIDES_PX:
        rows, columns = np.indices((size.height_px // stride, size.width_px // stride))
        parts.append(np.stack([columns, rows, np.full_like(rows, stride)], axis=-1).reshape(-1, 3))
    return np.concatenate(parts).astype(np.float32)


def _columns_after(first: int) -> Callable[[Outputs], int]:
    return lambda outputs: _only(outputs).shape[1] - first


_COCO = dict(enumerate(COCO_CLASSES))
_UNIT_SCALE = 1 / 255
FORMS: Mapping[OutputFormName, OutputForm] = {
    "trifuse": OutputForm(
        _decode_trifuse, lambda outputs: outputs["scores"].shape[-1], InputFormat(), {}
    ),
    "detr": OutputForm(
        _decode_labels, lambda _: None, InputFormat(scale=_UNIT_SCALE, resize="stretch"), _COCO
    ),
    "torchvision": OutputForm(
        _decode_labels,
        lambda _: None,
        InputFormat(scale=_UNIT_SCALE),
        dict(zip(COCO_NUMBERS, COCO_CLASSES, strict=True)),
    ),
    "ultralytics-end-to-end": OutputForm(
        _decode_end_to_end,
        lambda _: None,
        InputFormat(scale=_UNIT_SCALE, alignment="center"),
        _COCO,
    ),
    "ultralytics": OutputForm(
        _decode_ultralytics,
        lambda outputs: _only(outputs).shape[0] - 4,
        InputFormat(scale=_UNIT_SCALE, alignment="center"),
        _COCO,
    ),
    "yolox": OutputForm(_decode_yolox, _columns_after(5), InputFormat(color_order="BGR"), _COCO),
    "yolo": OutputForm(
        _decode_yolo, _columns_after(5), InputFormat(scale=_UNIT_SCALE, alignment="center"), _COCO
    ),
}
