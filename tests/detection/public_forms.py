"""Small networks with the inputs and outputs of public detectors: outputs that do not depend on the image.

Each finds a car, a truck and a kite. Their first output also holds 0 times the mean of the image, so that the image is
an input of the graph.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from perception.detection.detectors.class_columns import COCO_CLASSES, COCO_NUMBERS

HEIGHT, WIDTH = 64, 96
SIDES = np.array([WIDTH, HEIGHT, WIDTH, HEIGHT], np.float32)
COCO_ORDER = range(80)
CELLS = 8 * 12 + 4 * 6 + 2 * 3
CAR, BUS, TRUCK, PERSON, KITE = (
    COCO_CLASSES.index(n) for n in ("car", "bus", "truck", "person", "kite")
)
IMAGE = np.zeros((2 * HEIGHT, 2 * WIDTH, 3), np.uint8)  # twice the input
CAR_PX = [20.0, 40.0, 100.0, 90.0]  # in the image
TRUCK_PX = [120.0, 10.0, 180.0, 60.0]


def rows_of(scores, boxes_px, columns, count, first=0):
    """Return (1, count, 4 + columns) rows: two boxes in pixels of the input, center and size, then scores."""
    rows = np.zeros((1, count, 4 + columns), np.float32)
    for row, (of_row, box) in enumerate(zip(scores, boxes_px, strict=True), first):
        x1, y1, x2, y2 = np.array(box) / 2
        rows[0, row, :4] = (x1 + x2) / 2, (y1 + y2) / 2, x2 - x1, y2 - y1
        for number, score in of_row.items():
            rows[0, row, 4 + number] = score
    return rows


SCORES = [{CAR: 0.8, KITE: 0.9}, {BUS: 0.3, TRUCK: 0.5}]


def yolo(count=3 * CELLS):
    with_objectness = [{0: 0.5} | {1 + n: 2 * s for n, s in one.items()} for one in SCORES]
    return {"output": rows_of(with_objectness, [CAR_PX, TRUCK_PX], 81, count)}


def yolox():
    """Write the rows in cells of 8 pixels: xy as an offset of the cell, sizes as logarithms."""
    rows = yolo(CELLS)["output"]
    place = np.arange(2)  # of the cells (row 0, columns 0 and 1)
    rows[0, :, 2:4] = np.log(np.maximum(rows[0, :, 2:4], 1e-3) / 8)
    rows[0, :2, :2] = rows[0, :2, :2] / 8 - np.stack([place, 0 * place], axis=1)
    return {"output": rows}


def labelled(numbers=COCO_ORDER, scale=2.0):
    """Return boxes in pixels of the input, numbers of their classes, and scores: a car, a truck, a kite."""
    corners = np.array([CAR_PX, TRUCK_PX, CAR_PX], np.float32) / scale
    found = [numbers[n] for n in (CAR, TRUCK, KITE)]
    return corners, np.array(found, np.int64), np.array([0.8, 0.5, 0.9], np.float32)


def detr():
    boxes, labels, scores = labelled()
    return {"labels": labels[None], "boxes": boxes[None] / SIDES, "scores": scores[None]}


def torchvision():
    boxes, labels, scores = labelled(COCO_NUMBERS)
    return {"boxes": boxes, "labels": labels, "scores": scores}


def suppressed(numbers=COCO_ORDER):
    """Return the outputs of a suppression within the network, with one row more than it counts."""
    boxes, labels, scores = labelled(numbers)
    boxes, labels = np.vstack([boxes, [[1, 1, 60, 60]]]), np.append(labels, numbers[CAR])
    return boxes.astype(np.float32)[None], np.append(scores, np.float32(1))[None], labels[None]


def efficient_nms():
    boxes, scores, labels = suppressed()
    count, labels = np.array([[3]], np.int32), labels.astype(np.int32)
    return {"num_dets": count, "det_boxes": boxes, "det_scores": scores, "det_classes": labels}


def tensorflow():
    boxes, scores, labels = suppressed(COCO_NUMBERS)
    return {
        "detection_scores:0": scores,
        "detection_boxes:0": (boxes / SIDES)[..., [1, 0, 3, 2]],
        "detection_classes:0": labels.astype(np.float32),
        "num_detections:0": np.array([3], np.float32),
    }


def unit_boxes():
    boxes = labelled()[0] / SIDES
    centers, sizes = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    return np.hstack([centers, sizes])[None]


def logits(columns, numbers=COCO_ORDER):
    """Return (1, 3, columns) logits of independent classes."""
    _, labels, scores = labelled(numbers)
    rows = np.full((1, 3, columns), -30, np.float32)
    rows[0, [0, 1, 2], labels] = np.log(scores / (1 - scores))
    return rows


def detr_softmax(columns=92, numbers=COCO_NUMBERS):
    """Return logits of classes that exclude each other; the last one is no object."""
    _, labels, scores = labelled(numbers)
    rows = np.full((1, 3, columns), -30, np.float32)
    rows[0, [0, 1, 2], labels], rows[0, :, -1] = np.log(scores), np.log(1 - scores)
    return {"logits": rows + np.float32(5), "pred_boxes": unit_boxes()}


def end_to_end(further=0):
    boxes, labels, scores = labelled()
    rows = np.hstack([boxes, scores[:, None], labels[:, None].astype(np.float32)])
    return {"output0": np.hstack([rows, np.full((3, further), 0.7, np.float32)])[None]}


def yolov7_end_to_end():
    rows = end_to_end()["output0"][0][:, [0, 0, 1, 2, 3, 5, 4]]
    rows[:, 0] = 0
    of_another_image = rows[:1] + np.array([1, 5, 5, 5, 5, 0, 0.1], np.float32)
    return {"output": np.vstack([rows, of_another_image])}


def ultralytics(further=0):
    rows = rows_of(SCORES, [CAR_PX, TRUCK_PX], 80, CELLS)
    return {"output0": with_columns(rows, further).transpose(0, 2, 1).copy()}


def with_columns(rows, count):
    """Append columns that no box has scores in."""
    return np.concatenate([rows, np.full((*rows.shape[:2], count), 0.7, np.float32)], axis=2)


MASKS = {"output1": np.zeros((1, 32, HEIGHT // 4, WIDTH // 4), np.float32)}
LAYERS = {f"layer{n}": np.ones((1, 3, 8 >> n, 12 >> n, 85), np.float32) for n in range(3)}
# Of each form one or more networks: their outputs, and what else is special about them.
FORMS = {
    "yolox": [(yolox, {})],
    "yolo": [
        (yolo, {}),
        (lambda: yolo(CELLS), {}),
        (lambda: {"output0": with_columns(yolo()["output"], 32)} | MASKS, {}),
        (lambda: yolo() | LAYERS, {}),
    ],
    "yolov7-end-to-end": [(yolov7_end_to_end, {})],
    "ultralytics": [
        (ultralytics, {}),
        (lambda: ultralytics(32) | MASKS, {}),
        (lambda: ultralytics(51), {"metadata": {"kpt_shape": "[17, 3]"}}),
    ],
    "ultralytics-end-to-end": [
        (end_to_end, {}),
        (lambda: {"output0": end_to_end()["output0"][0]}, {}),
        (lambda: end_to_end(32) | MASKS, {}),
        (lambda: end_to_end(51), {"metadata": {"kpt_shape": "[17, 3]"}}),
    ],
    "ultralytics-detr": [
        (lambda: {"output0": np.dstack([unit_boxes(), 1 / (1 + np.exp(-logits(80)))])}, {}),
    ],
    "detr": [(detr, {"sizes": True})],
    "detr-sigmoid": [(lambda: {"logits": logits(80), "pred_boxes": unit_boxes()}, {})],
    "detr-softmax": [
        (detr_softmax, {"mask": True}),
        (lambda: detr_softmax(81, COCO_ORDER), {}),
    ],
    "rf-detr": [
        (lambda: {"dets": unit_boxes(), "labels": logits(91, COCO_NUMBERS)}, {}),
        (lambda: {"logits": logits(91, COCO_NUMBERS), "pred_boxes": unit_boxes()}, {}),
    ],
    "efficient-nms": [(efficient_nms, {})],
    "tensorflow": [
        (tensorflow, {"image_shape": (1, HEIGHT, WIDTH, 3), "image_type": TensorProto.UINT8})
    ],
    "torchvision": [(torchvision, {"image_shape": (3, HEIGHT, WIDTH)})],
}
NETWORKS = [(form, number) for form, networks in FORMS.items() for number in range(len(networks))]


def write_network(path: Path, form: str, number: int = 0, **options) -> Path:
    """Write one of the networks of a form."""
    outputs, usual = FORMS[form][number]
    return write_constant_network(path, outputs(), **{**usual, **options})


def write_constant_network(
    path: Path,
    outputs: Mapping[str, np.ndarray],
    image_shape: tuple[int | str, ...] = (1, 3, 64, 96),
    *,
    sizes: bool = False,
    mask: bool = False,
    metadata: Mapping[str, str] | None = None,
    image_type: int = TensorProto.FLOAT,
) -> Path:
    """Write a network that returns arrays, whatever the image.

    `sizes` adds the input `orig_target_sizes`, whose width and height scale the `boxes` of 0 to 1; `mask` the input
    `pixel_mask`, without which the first output is less.
    """
    inputs = [helper.make_tensor_value_info("images", image_type, image_shape)]
    nodes = [
        helper.make_node("Cast", ["images"], ["numbers"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMean", ["numbers"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "zero"], ["nothing"]),
    ]
    constants = [numpy_helper.from_array(np.float32(0), "zero")]
    if mask:
        inputs.append(helper.make_tensor_value_info("pixel_mask", TensorProto.INT64, [1, 64, 64]))
        nodes[1:1] = [
            helper.make_node("Cast", ["pixel_mask"], ["shown"], to=TensorProto.FLOAT),
            helper.make_node("ReduceMin", ["shown"], ["is_shown"], keepdims=0),
        ]
        nodes[-1] = helper.make_node("Sub", ["is_shown", "one"], ["nothing"])
        constants.append(numpy_helper.from_array(np.float32(1), "one"))
    if sizes:
        inputs.append(
            helper.make_tensor_value_info("orig_target_sizes", TensorProto.INT64, ["n", 2])
        )
        nodes += [
            helper.make_node("Cast", ["orig_target_sizes"], ["size"], to=TensorProto.FLOAT),
            helper.make_node("Concat", ["size", "size"], ["rows"], axis=1),
            helper.make_node("Unsqueeze", ["rows", "axis"], ["sizes"]),
        ]
        constants.append(numpy_helper.from_array(np.array([1]), "axis"))
    values = []
    for name, array in outputs.items():
        kind = helper.np_dtype_to_tensor_dtype(array.dtype)
        values.append(helper.make_tensor_value_info(name, kind, [None] * array.ndim))
        constants.append(numpy_helper.from_array(array, f"{name}_constant"))
        source = f"{name}_constant"
        if sizes and name == "boxes":
            nodes.append(helper.make_node("Mul", [source, "sizes"], ["scaled"]))
            source = "scaled"
        if array.dtype == np.float32:
            nodes.append(helper.make_node("Add", [source, "nothing"], [name]))
        else:
            nodes.append(helper.make_node("Identity", [source], [name]))
    graph = helper.make_graph(nodes, "constant", inputs, values, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    helper.set_model_props(model, dict(metadata or {}))
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return path
