"""Forms of the outputs of public detectors: K boxes, S classes; how each is told apart, and what input it usually has."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from perception.detection.detectors.class_columns import COCO_CLASSES, COCO_NUMBERS, ClassColumns
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.network_input import Alignment, Resize
from perception.detection.detectors.network_outputs import NetworkOutputs, Outputs
from perception.detection.detectors.output_decoding import (
    Predictions,
    decode_columns,
    decode_labels,
    decode_numbered_rows,
    decode_rows,
    decode_sigmoid,
    decode_softmax,
    decode_tensorflow,
    decode_trifuse,
    decode_unit_rows,
    decode_yolo,
    decode_yolox,
)

OutputFormName = Literal[
    "trifuse", "detr", "torchvision", "tensorflow", "efficient-nms", "detr-softmax", "rf-detr", "detr-sigmoid",
    "yolox", "yolo", "yolov7-end-to-end", "ultralytics-end-to-end", "ultralytics", "ultralytics-detr",
]  # fmt: skip
OUTPUT_FORMS: tuple[OutputFormName, ...] = get_args(OutputFormName)
ColorOrder = Literal["RGB", "BGR"]


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
        if class_count is None:
            return self.labelled_coco or _COCO
        return _COCO_BY_COUNT.get(class_count, {})


def recognized_form(outputs: NetworkOutputs) -> OutputFormName | None:
    """Return the first form that the outputs of a network have, None where no form is theirs."""
    return next((name for name, form in FORMS.items() if form.matches(outputs)), None)


FORMS: Mapping[OutputFormName, OutputForm] = {
    "trifuse": OutputForm(
        "boxes_px (1, K, 4), scores (1, K, S)",
        lambda found: found.has("boxes_px", "scores"),
        decode_trifuse,
        _BYTES,
        lambda found: found.arrays["scores"].shape[-1],
    ),
    "detr": OutputForm(  # DEIM, D-FINE, RT-DETR
        "labels, boxes, scores (1, K), beside the input orig_target_sizes",
        lambda found: found.has("labels", "boxes", "scores") and found.has_sizes,
        decode_labels,
        _STRETCHED,
    ),
    "tensorflow": OutputForm(  # classes by COCO's numbers
        "num_detections (1), detection_boxes (1, K, 4) y1 x1 y2 x2 from 0 to 1, detection_scores, detection_classes",
        lambda found: (
            found.has("count", "boxes", "scores", "labels") and found.arrays["count"].ndim < 2
        ),
        decode_tensorflow,
        _BYTES,
        labelled_coco=_NUMBERED_COCO,
    ),
    "efficient-nms": OutputForm(
        "num_dets (1, 1), det_boxes (1, K, 4), det_scores, det_classes (1, K)",
        lambda found: found.has("count", "boxes", "scores", "labels"),
        decode_labels,
        _CENTERED,
    ),
    "torchvision": OutputForm(  # classes by COCO's numbers
        "boxes (K, 4), labels, scores (K)",
        lambda found: found.has("labels", "boxes", "scores"),
        decode_labels,
        _UNIT,
        labelled_coco=_NUMBERED_COCO,
    ),
    "detr-softmax": OutputForm(  # DETR, YOLOS
        "logits (1, K, S + 1), pred_boxes (1, K, 4) center and size from 0 to 1",
        lambda found: (
            found.has("logits", "pred_boxes") and found.logit_classes < found.logit_columns
        ),
        decode_softmax,
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
        decode_sigmoid,
        _IMAGENET,
        lambda found: found.logit_classes,
    ),
    "detr-sigmoid": OutputForm(  # RT-DETR and D-FINE without their last step
        "logits (1, K, S), pred_boxes (1, K, 4) center and size from 0 to 1",
        lambda found: found.has("logits", "pred_boxes"),
        decode_sigmoid,
        _STRETCHED,
        lambda found: found.logit_columns,
    ),
    "yolox": OutputForm(
        "(1, K, 5 + S): center and size relative to cells of 8, 16 and 32 pixels, objectness, scores",
        lambda found: found.table[-1] > 5 and len(found.table) == 3 and found.has_offsets,
        decode_yolox,
        InputFormat(color_order="BGR"),
        lambda found: found.table[-1] - found.further_columns - 5,
    ),
    "yolo": OutputForm(  # YOLOv5, YOLOv6, YOLOv7
        "(1, K, 5 + S): center and size in pixels, objectness, scores",
        lambda found: (
            found.table[-1] > 5 and len(found.table) == 3 and found.is_dense(found.table[-2])
        ),
        decode_yolo,
        _CENTERED,
        lambda found: found.table[-1] - found.further_columns - 5,
    ),
    "yolov7-end-to-end": OutputForm(
        "(K, 7): image, x1 y1 x2 y2, class, score",
        lambda found: len(found.table) == 2 and found.table[0] != 1 and found.table[1] == 7,
        decode_numbered_rows,
        _CENTERED,
    ),
    "ultralytics-end-to-end": OutputForm(
        "(1, K, 6) or (K, 6): x1 y1 x2 y2, score, class",
        lambda found: (
            found.table[-1] == 6 + found.further_columns
            and (len(found.table) == 3 or found.table[0] != 1)
            and found.has_class_numbers
        ),
        decode_rows,
        _CENTERED,
    ),
    "ultralytics": OutputForm(
        "(1, 4 + S, K): center and size in pixels, scores",
        lambda found: (
            len(found.table) == 3 and found.table[1] > 4 and found.is_dense(found.table[2])
        ),
        decode_columns,
        _CENTERED,
        lambda found: found.table[1] - found.further_columns - 4,
    ),
    "ultralytics-detr": OutputForm(
        "(1, K, 4 + S): center and size from 0 to 1, scores",
        lambda found: len(found.table) == 3 and found.table[-1] == 4 + (found.named_classes or 80),
        decode_unit_rows,
        _STRETCHED,
        lambda found: found.table[-1] - 4,
    ),
}
