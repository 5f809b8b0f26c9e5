"""Forms of the outputs of public detectors: how each is told apart, and how it becomes boxes.

K boxes, S classes of the network, C classes that are reported. All become (K, 4) boxes x1 y1 x2 y2 in pixels of the
input, and (K, C) scores. Of a batch the first image counts.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np

from perception.detection.detectors.class_columns import COCO_CLASSES, COCO_NUMBERS, ClassColumns
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.network_input import Alignment, Resize
from perception.detection.detectors.network_outputs import (
    NetworkOutputs,
    Outputs,
    cells_px,
    of_first_image,
    tables,
)
from perception.types import Float, Float32

OutputFormName = Literal[
    "trifuse", "detr", "torchvision", "tensorflow", "efficient-nms", "detr-softmax", "rf-detr", "detr-sigmoid",
    "yolox", "yolo", "yolov7-end-to-end", "ultralytics-end-to-end", "ultralytics", "ultralytics-detr",
]  # fmt: skip
OUTPUT_FORMS: tuple[OutputFormName, ...] = get_args(OutputFormName)
ColorOrder = Literal["RGB", "BGR"]

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


_BYTES = InputFormat()
_UNIT = InputFormat(scale=1 / 255)
_CENTERED = InputFormat(scale=1 / 255, alignment="center")
_STRETCHED = InputFormat(scale=1 / 255, resize="stretch")
_IMAGENET = InputFormat(
    scale=1 / 255, mean=(0.485, 0.456, 0.406), std=(0.229, 0.224, 0.225), resize="stretch"
)
_COCO = dict(enumerate(COCO_CLASSES))
_NUMBERED_COCO = dict(zip(COCO_NUMBERS, COCO_CLASSES, strict=True))
_COCO_BY_COUNT: Mapping[int, Mapping[int, str]] = {80: _COCO, 91: _NUMBERED_COCO}


@dataclass(frozen=True)
class OutputForm:
    """A form of outputs, and the input that networks of this form usually take.

    Attributes:
        layout: Names and shapes of the outputs, in words.
        matches: Function that returns whether outputs are of this form.
        decode: Function of outputs, input size and classes that returns the predictions.
        input: Usual input.
        class_count: Function that returns the number of the network's classes; None where labels number them.
        labelled_coco: Names of COCO's classes by the numbers of labels.
    """

    layout: str
    matches: Callable[[NetworkOutputs], bool]
    decode: Callable[[Outputs, InputSize, ClassColumns], Predictions]
    input: InputFormat
    class_count: Callable[[NetworkOutputs], int] | None = None
    labelled_coco: Mapping[int, str] | None = None

    def coco(self, class_count: int | None) -> Mapping[int, str]:
        """Return the names of COCO's classes by number, none for a network of another number of classes."""
        return (
            (self.labelled_coco or _COCO)
            if class_count is None
            else _COCO_BY_COUNT.get(class_count, {})
        )


def recognized_form(outputs: NetworkOutputs) -> OutputFormName | None:
    """Return the first form that the outputs of a network have, None where no form is theirs."""
    return next((name for name, form in FORMS.items() if form.matches(outputs)), None)


def _decode_trifuse(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    return Predictions(outputs["boxes_px"][0], classes.of_scores(outputs["scores"][0]))


def _decode_labels(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    boxes_px = of_first_image(outputs["boxes"], 2)
    scores, labels = (of_first_image(outputs[name], 1) for name in ("scores", "labels"))
    count = int(outputs["count"].flat[0]) if "count" in outputs else len(labels)
    found = classes.of_labels(
        np.rint(labels[:count]), scores[:count].astype(np.float32, copy=False)
    )
    return Predictions(boxes_px[:count], found)


def _decode_tensorflow(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    boxes, scores = _decode_labels(outputs, size, classes)  # y1 x1 y2 x2
    return Predictions(boxes[:, [1, 0, 3, 2]] * _sides_px(size), scores)


def _decode_softmax(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    from scipy.special import softmax

    scores = softmax(of_first_image(outputs["logits"], 2).astype(np.float32), axis=-1)
    return Predictions(_unit_boxes(outputs["pred_boxes"], size), classes.of_scores(scores))


def _decode_sigmoid(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    from scipy.special import expit

    logits = outputs["logits"] if "logits" in outputs else outputs["labels"]
    scores = expit(classes.of_scores(of_first_image(logits, 2).astype(np.float32)))
    return Predictions(_unit_boxes(outputs["pred_boxes"], size), scores)


def _decode_rows(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    rows = _only(outputs)
    return Predictions(rows[:, :4], classes.of_labels(np.rint(rows[:, 5]), rows[:, 4]))


def _decode_numbered_rows(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    rows = _only(outputs)
    rows = rows[rows[:, 0] == 0]  # of the first image of the batch
    return Predictions(rows[:, 1:5], classes.of_labels(np.rint(rows[:, 5]), rows[:, 6]))


def _decode_columns(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    rows = _only(outputs).T
    return Predictions(_corner_boxes(rows), classes.of_scores(rows[:, 4:]))


def _decode_unit_rows(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    rows = _only(outputs)
    return Predictions(_unit_boxes(rows[:, :4], size), classes.of_scores(rows[:, 4:]))


def _decode_yolox(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    rows, cells = _only(outputs), cells_px(size)
    strides_px = cells[:, 2:]
    centers_px = (rows[:, :2] + cells[:, :2]) * strides_px
    sizes_px = np.exp(np.minimum(rows[:, 2:4], _MAX_LOG_SIZE)) * strides_px
    boxes_px = _corner_boxes(np.hstack([centers_px, sizes_px]))
    return Predictions(boxes_px, _with_objectness(rows, classes))


def _decode_yolo(outputs: Outputs, size: InputSize, classes: ClassColumns) -> Predictions:
    rows = _only(outputs)
    return Predictions(_corner_boxes(rows), _with_objectness(rows, classes))


def _with_objectness(rows: Float32, classes: ClassColumns) -> Float32:
    return rows[:, 4:5] * classes.of_scores(rows[:, 5:])


def _only(outputs: Outputs) -> Float32:
    (array,) = tables(outputs)
    return of_first_image(array, 2).astype(np.float32, copy=False)


def _unit_boxes(boxes: Float32, size: InputSize) -> Float32:
    return _corner_boxes(of_first_image(boxes, 2)) * _sides_px(size)


def _sides_px(size: InputSize) -> Float32:
    return np.array([size.width_px, size.height_px] * 2, np.float32)


def _corner_boxes(rows: Float32) -> Float32:
    """Return the corners of boxes by rows that begin with center and size."""
    centers, halves = rows[:, :2], rows[:, 2:4] / 2
    return np.hstack([centers - halves, centers + halves])


FORMS: Mapping[OutputFormName, OutputForm] = {
    "trifuse": OutputForm(
        "boxes_px (1, K, 4), scores (1, K, S)",
        lambda found: found.has("boxes_px", "scores"),
        _decode_trifuse,
        _BYTES,
        lambda found: found.arrays["scores"].shape[-1],
    ),
    "detr": OutputForm(  # DEIM, D-FINE, RT-DETR
        "labels, boxes, scores (1, K), beside the input orig_target_sizes",
        lambda found: found.has("labels", "boxes", "scores") and found.has_sizes,
        _decode_labels,
        _STRETCHED,
    ),
    "tensorflow": OutputForm(  # classes by COCO's numbers
        "num_detections (1), detection_boxes (1, K, 4) y1 x1 y2 x2 from 0 to 1, detection_scores, detection_classes",
        lambda found: (
            found.has("count", "boxes", "scores", "labels") and found.arrays["count"].ndim < 2
        ),
        _decode_tensorflow,
        _BYTES,
        labelled_coco=_NUMBERED_COCO,
    ),
    "efficient-nms": OutputForm(
        "num_dets (1, 1), det_boxes (1, K, 4), det_scores, det_classes (1, K)",
        lambda found: found.has("count", "boxes", "scores", "labels"),
        _decode_labels,
        _CENTERED,
    ),
    "torchvision": OutputForm(  # classes by COCO's numbers
        "boxes (K, 4), labels, scores (K)",
        lambda found: found.has("labels", "boxes", "scores"),
        _decode_labels,
        _UNIT,
        labelled_coco=_NUMBERED_COCO,
    ),
    "detr-softmax": OutputForm(  # DETR, YOLOS
        "logits (1, K, S + 1), pred_boxes (1, K, 4) center and size from 0 to 1",
        lambda found: (
            found.has("logits", "pred_boxes") and found.logit_classes < found.logit_columns
        ),
        _decode_softmax,
        _IMAGENET,
        lambda found: found.logit_columns - 1,
    ),
    "rf-detr": OutputForm(  # and Deformable DETR, Conditional DETR with COCO's numbers
        "labels (1, K, S + 1) or logits (1, K, 91), dets or pred_boxes (1, K, 4) center and size from 0 to 1",
        lambda found: (
            found.has("pred_boxes")
            and found.logit_columns > 0
            and (found.has("labels") or found.logit_columns == 91)
        ),
        _decode_sigmoid,
        _IMAGENET,
        lambda found: found.logit_classes,
    ),
    "detr-sigmoid": OutputForm(  # RT-DETR and D-FINE without their last step
        "logits (1, K, S), pred_boxes (1, K, 4) center and size from 0 to 1",
        lambda found: found.has("logits", "pred_boxes"),
        _decode_sigmoid,
        _STRETCHED,
        lambda found: found.logit_columns,
    ),
    "yolox": OutputForm(
        "(1, K, 5 + S): center and size relative to cells of 8, 16 and 32 pixels, objectness, scores",
        lambda found: found.table[-1] > 5 and len(found.table) == 3 and found.has_offsets,
        _decode_yolox,
        InputFormat(color_order="BGR"),
        lambda found: found.table[-1] - found.further_columns - 5,
    ),
    "yolo": OutputForm(  # YOLOv5, YOLOv6, YOLOv7
        "(1, K, 5 + S): center and size in pixels, objectness, scores",
        lambda found: (
            found.table[-1] > 5 and len(found.table) == 3 and found.is_dense(found.table[-2])
        ),
        _decode_yolo,
        _CENTERED,
        lambda found: found.table[-1] - found.further_columns - 5,
    ),
    "yolov7-end-to-end": OutputForm(
        "(K, 7): image, x1 y1 x2 y2, class, score",
        lambda found: len(found.table) == 2 and found.table[0] != 1 and found.table[1] == 7,
        _decode_numbered_rows,
        _CENTERED,
    ),
    "ultralytics-end-to-end": OutputForm(
        "(1, K, 6) or (K, 6): x1 y1 x2 y2, score, class",
        lambda found: (
            found.table[-1] == 6 + found.further_columns
            and (len(found.table) == 3 or found.table[0] != 1)
        ),
        _decode_rows,
        _CENTERED,
    ),
    "ultralytics": OutputForm(
        "(1, 4 + S, K): center and size in pixels, scores",
        lambda found: (
            len(found.table) == 3 and found.table[1] > 4 and found.is_dense(found.table[2])
        ),
        _decode_columns,
        _CENTERED,
        lambda found: found.table[1] - found.further_columns - 4,
    ),
    "ultralytics-detr": OutputForm(
        "(1, K, 4 + S): center and size from 0 to 1, scores",
        lambda found: len(found.table) == 3 and found.table[-1] == 4 + (found.named_classes or 80),
        _decode_unit_rows,
        _STRETCHED,
        lambda found: found.table[-1] - 4,
    ),
}
