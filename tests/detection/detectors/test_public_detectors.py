"""Detectors of other makers as ONNX files: told apart by their outputs, described by a YAML file."""

import os
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto

from perception.detection.detectors.class_columns import COCO_CLASSES, COCO_NUMBERS
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.errors import ModelError, UsageError
from tests.detection.public_forms import write_constant_network
from tests.faults import fault

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


@pytest.fixture
def write(tmp_path):
    def write(form, number=0, **options):
        make, usual = FORMS[form][number]
        return write_constant_network(tmp_path / "public.onnx", make(), **{**usual, **options})

    return write


@pytest.mark.parametrize(("form", "number"), NETWORKS)
def test_each_form_is_known_by_its_outputs_and_reports_our_classes(write, form, number):
    detector = ModalityDetector(write(form, number))
    assert (detector.modality, detector.size) == ("rgb", (HEIGHT, WIDTH))
    assert detector.title == f"public.onnx ({form})"
    assert detector.class_names == ("Car", "Truck", "Pedestrian", "Cyclist")
    found = detector.detect(IMAGE)
    np.testing.assert_allclose(found.boxes_px, [CAR_PX, TRUCK_PX], atol=1e-4)
    np.testing.assert_allclose(found.scores, [0.8, 0.5], rtol=1e-6)
    assert found.types.tolist() == ["Car", "Truck"]


def test_boxes_of_a_letterbox_are_in_the_image(write):
    wide = np.zeros((HEIGHT, 2 * WIDTH, 3), np.uint8)
    # Half the height, in the middle: the rows of the input above and below it are padding.
    found = ModalityDetector(write("ultralytics")).detect(wide)
    np.testing.assert_allclose(found.boxes_px[0], [20, 8, 100, 58], atol=1e-4)


@pytest.mark.parametrize("form", ["yolox", "torchvision", "ultralytics"])
def test_half_precision_and_free_axes(write, form):
    shape = ("n", 3, "h", "w") if form != "torchvision" else (3, "h", "w")
    path = write(form, image_shape=shape, image_type=TensorProto.FLOAT16)
    path.with_suffix(".yaml").write_text(f"input_size: {HEIGHT}x{WIDTH}")
    found = ModalityDetector(path).detect(IMAGE)
    np.testing.assert_allclose(found.boxes_px, [CAR_PX, TRUCK_PX], atol=1e-4)


def test_a_yaml_file_names_classes_by_name_or_number(write, tmp_path):
    write("ultralytics")
    (tmp_path / "mine.yaml").write_text(
        "model: public.onnx\nclasses: {kite: Tram, 2: Van}\nresize: stretch\n"
    )
    detector = ModalityDetector(tmp_path / "mine.yaml")
    assert detector.class_names == ("Tram", "Van")
    assert detector.detect(IMAGE).types.tolist() == ["Tram", "Van"]


def test_names_of_classes_in_the_file_itself(write, tmp_path):
    path = write_constant_network(
        tmp_path / "own.onnx",
        {"output0": np.zeros((1, 4 + 3, CELLS), np.float32)},
        metadata={"names": "{0: 'cyclist', 1: 'van', 2: 'tree'}"},
    )
    assert ModalityDetector(path).class_names == ("Van", "Cyclist")


def test_fingerprint_depends_on_file_and_description(write):
    path = write("yolox")
    first = ModalityDetector(path).fingerprint
    path.with_suffix(".yaml").write_text("color_order: RGB")
    second = ModalityDetector(path).fingerprint
    path.with_suffix(".yaml").write_text("color_order: BGR")
    assert len({first, second, ModalityDetector(path).fingerprint}) == 3


def test_pixels_are_scaled_shifted_and_in_the_order_of_the_network(write):
    path = write("yolox")
    path.with_suffix(".yaml").write_text("scale: 0.5\nmean: [1, 2, 3]\nstd: [1, 1, 4]")
    image = np.full((HEIGHT, WIDTH, 3), [10, 20, 31], np.uint8)
    shown = ModalityDetector(path).preprocess(image)
    assert (shown.shape, shown.dtype) == ((1, 3, HEIGHT, WIDTH), np.float32)
    # Of YOLOX: blue, green, red.
    np.testing.assert_allclose(shown[0, :, 5, 7], [31 / 2 - 1, 20 / 2 - 2, (10 / 2 - 3) / 4])


def test_tiles_find_each_object_once(write):
    path = write("ultralytics")
    path.with_suffix(".yaml").write_text("resize: tiles")
    found = ModalityDetector(path).detect(np.zeros((HEIGHT, 2 * WIDTH, 3), np.uint8))
    # The boxes of the network are those of the whole image and of each of three tiles.
    assert sorted(found.types.tolist()) == ["Car"] * 4 + ["Truck"] * 4


@pytest.mark.parametrize(
    ("outputs", "expected", "found"),
    [
        ({"a": np.zeros((1, 7), np.float32)}, "outputs of a known form: trifuse, detr", "a (1, 7)"),
        (
            {"output0": np.zeros((1, 4 + 3, CELLS), np.float32)},
            "classes by the names car, van, truck",
            "3 classes",
        ),
    ],
)
def test_networks_that_are_no_known_detector(tmp_path, outputs, expected, found):
    path = write_constant_network(tmp_path / "other.onnx", outputs)
    with fault(ModelError, where="other.onnx", expected=expected, found=found):
        ModalityDetector(path)


def test_inputs_that_are_no_image(tmp_path):
    path = write_constant_network(tmp_path / "rows.onnx", yolox(), image_shape=(1, 64, 96, 4))
    expected = "one image (batch, 3, height, width) or (batch, height, width, 3) of uint8"
    with fault(ModelError, where="rows.onnx", expected=expected, found="images float32 1 x 64"):
        ModalityDetector(path)


@pytest.mark.parametrize(
    ("text", "where", "expected", "found"),
    [
        (
            "classes: {rocket: Car}",
            "public.onnx",
            "classes of the network: person, bicycle",
            "rocket",
        ),
        (
            "classes: {car: Car, person + bicycle: Cyclist}",
            "public.onnx",
            "an entry of person before person + bicycle",
            "car, person + bicycle",
        ),
        ("classes: {80: Car}", "public.onnx", "classes of the network: person", "80"),
        ("class_names: [car, van]", "public.onnx", "scores of 2 classes: car, van", "scores of 80"),
    ],
)
def test_descriptions_that_do_not_fit(write, text, where, expected, found):
    path = write("yolox")
    path.with_suffix(".yaml").write_text(text)
    with fault(ModelError, where=where, expected=expected, found=found):
        ModalityDetector(path)


@pytest.mark.parametrize(
    ("text", "where", "expected", "found"),
    [
        ("sise: 3", "public.yaml", "some of model, modality, classes", "sise"),
        ("- car", "public.yaml", "entries such as", "['car']"),
        ("{", "public.yaml", "a YAML file of a detector", "while parsing"),
        ("resize: crop", "public.yaml, resize", "one of letterbox, stretch, tiles", "crop"),
        ("output: yolo9", "public.yaml, output", "one of trifuse, detr", "yolo9"),
        ("pad_value: 300", "public.yaml, pad_value", "a whole number from 0 to 255", "300"),
        ("mean: bright", "public.yaml, mean", "a number, or one of each colour", "bright"),
        ("classes: [car]", "public.yaml, classes", "a class for each", "['car']"),
        ("class_names: car", "public.yaml, class_names", "a list of names", "car"),
        ("input_size: 100x100", "input size", "multiples of 32", "100x100"),
    ],
)
def test_descriptions_that_are_none(write, text, where, expected, found):
    path = write("yolox")
    path.with_suffix(".yaml").write_text(text)
    with fault(UsageError, where=where, expected=expected, found=found):
        ModalityDetector(path)


def test_a_yaml_file_that_is_not_there(tmp_path):
    with fault(UsageError, where="gone.yaml", expected="a YAML file of a detector"):
        ModalityDetector(tmp_path / "gone.yaml")


@pytest.fixture(scope="module")
def public_networks():
    root = Path(__file__).parents[4] / "shared" / "public_networks"
    root = Path(os.environ.get("PUBLIC_NETWORKS", root))
    if not root.is_dir():
        pytest.skip("no public networks: set PUBLIC_NETWORKS to their folder")
    return root


def test_a_fixed_size_is_widened(public_networks, tmp_path):
    (tmp_path / "wide.yaml").write_text(
        f"model: {public_networks / 'yolox_nano.onnx'}\ninput_size: 96x320"
    )
    detector = ModalityDetector(tmp_path / "wide.yaml")
    assert detector.preprocess(np.zeros((375, 1242, 3), np.uint8)).shape == (1, 3, 96, 320)
    assert detector.preprocess(np.zeros((720, 1280, 3), np.uint8)).shape == (1, 3, 128, 224)


def test_a_size_that_the_graph_does_not_allow(public_networks, tmp_path):
    (tmp_path / "wide.yaml").write_text(
        f"model: {public_networks / 'deimv2_femto.onnx'}\ninput_size: 96x320"
    )
    with fault(
        ModelError,
        where="deimv2_femto.onnx",
        expected="a graph that takes images of 96x320 instead of 416x416",
    ):
        ModalityDetector(tmp_path / "wide.yaml")


def test_a_person_on_a_bicycle_is_detected_as_a_cyclist(tmp_path):
    person_px, bicycle_px = [40.0, 20.0, 70.0, 80.0], [36.0, 54.0, 80.0, 100.0]
    bicycle = COCO_CLASSES.index("bicycle")
    scores = [{0: 1.0, 1 + PERSON: 0.9}, {0: 1.0, 1 + bicycle: 0.4}]
    rows = rows_of(scores, [person_px, bicycle_px], 81, 3 * CELLS)
    path = write_constant_network(tmp_path / "public.onnx", {"output": rows})
    found = ModalityDetector(path).detect(IMAGE)
    assert found.types.tolist() == ["Cyclist", "Pedestrian"]
    np.testing.assert_allclose(found.scores, [0.6, 0.54], rtol=1e-5)
    np.testing.assert_allclose(found.boxes_px[0], [36, 20, 80, 100], rtol=1e-5)
