"""Detectors of other makers as ONNX files: told apart by their outputs, described by a YAML file."""

import os
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto

from perception.detection.detectors.class_columns import COCO_CLASSES
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.output_forms import OUTPUT_FORMS
from perception.errors import ModelError, UsageError
from tests.detection.public_forms import (
    CAR_PX,
    CELLS,
    FORMS,
    HEIGHT,
    IMAGE,
    NETWORKS,
    PERSON,
    TRUCK_PX,
    WIDTH,
    efficient_nms,
    rows_of,
    write_constant_network,
    write_network,
)
from tests.faults import fault


@pytest.fixture
def write(tmp_path):
    return partial(write_network, tmp_path / "public.onnx")


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


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ("{0: 'cyclist', 1: 'van', 2: 'tree'}", ("Van", "Cyclist")),
        ('["Truck", "Tree", "CAR"]', ("Car", "Truck")),
    ],
)
def test_names_of_classes_in_the_file_itself(tmp_path, names, expected):
    path = write_constant_network(
        tmp_path / "own.onnx",
        {"output0": np.zeros((1, 4 + 3, CELLS), np.float32)},
        metadata={"names": names},
    )
    assert ModalityDetector(path).class_names == expected


def test_names_of_classes_tell_which_labels_count(tmp_path):
    path = write_constant_network(
        tmp_path / "own.onnx", efficient_nms(), metadata={"names": "{2: 'tram', 7: 'van'}"}
    )
    detector = ModalityDetector(path)
    assert detector.class_names == ("Van",)
    np.testing.assert_allclose(detector.detect(IMAGE).boxes_px, [TRUCK_PX], atol=1e-4)


@pytest.mark.parametrize("number_of_classes", [3, 4])
def test_one_logit_more_than_names_is_no_object(tmp_path, number_of_classes):
    names = ["tree", "car", "van", "truck"][:number_of_classes]
    logits = np.log(np.array([[[0.1, 0.7, 0.1, 0.1]]], np.float32))
    box = np.array([[[0.5, 0.5, 0.5, 0.25]]], np.float32)  # center and size
    path = write_constant_network(
        tmp_path / "own.onnx",
        {"logits": logits, "pred_boxes": box},
        metadata={"names": str(names)},
    )
    found = ModalityDetector(path).detect(IMAGE)
    first = np.argmax(found.scores)
    np.testing.assert_allclose(found.boxes_px[first], [48, 48, 144, 80], atol=1e-4)
    # Softmax, or the logistic function of the car's logit alone.
    expected = 0.7 if number_of_classes == 3 else 0.7 / 1.7
    assert found.scores[first] == pytest.approx(expected)
    assert found.types[first] == "Car"


@pytest.mark.parametrize(
    ("row", "form", "expected_px", "score"),
    [
        # Center and size from 0 to 1, and two scores; or corners in pixels, score and number of the class.
        ([0.5, 0.5, 0.5, 0.25, 0.1, 0.8], "ultralytics-detr", [48, 48, 144, 80], 0.8),
        ([24, 24, 72, 40, 0.8, 1], "ultralytics-end-to-end", [48, 48, 144, 80], 0.8),
    ],
)
def test_two_scores_are_distinguished_from_a_score_and_a_class(
    tmp_path, row, form, expected_px, score
):
    path = write_constant_network(
        tmp_path / "two.onnx",
        {"output0": np.array([[row]], np.float32)},
        metadata={"names": "{0: 'van', 1: 'car'}"},
    )
    detector = ModalityDetector(path)
    assert detector.title == f"two.onnx ({form})"
    found = detector.detect(IMAGE)
    best = np.argmax(found.scores)
    np.testing.assert_allclose(found.boxes_px[best], expected_px, atol=1e-4)
    assert (found.types[best], found.scores[best]) == ("Car", pytest.approx(score))


@pytest.mark.parametrize("suppresses", [False, True])
def test_a_pose_network_needs_no_file_of_classes(tmp_path, suppresses):
    person_px, keypoints = [40.0, 20.0, 70.0, 80.0], np.full((1, CELLS, 51), 33, np.float32)
    rows = rows_of([{0: 0.9}], [person_px], 1, CELLS)
    table = np.concatenate([rows, keypoints], axis=2).transpose(0, 2, 1)
    if suppresses:
        kept = [[*np.array(person_px) / 2, 0.9, 0, *keypoints[0, 0]]]
        table = np.array([kept], np.float32)
    path = write_constant_network(
        tmp_path / "pose.onnx",
        {"output0": np.ascontiguousarray(table)},
        metadata={"names": "{0: 'person'}", "kpt_shape": "[17, 3]", "task": "pose"},
    )
    detector = ModalityDetector(path)
    assert detector.class_names == ("Pedestrian",)
    found = detector.detect(IMAGE)
    np.testing.assert_allclose(found.boxes_px, [person_px], atol=1e-4)
    np.testing.assert_allclose(found.scores, [0.9], rtol=1e-6)


def test_masks_are_left_out(write):
    detector = ModalityDetector(write("ultralytics", 1))
    assert [*detector.model({"images": detector.preprocess(IMAGE)})] == ["output0"]


@pytest.mark.parametrize("form", ["yolov7-end-to-end", "ultralytics-end-to-end", "efficient-nms"])
def test_no_box_after_suppression(tmp_path, form):
    outputs = FORMS[form][0][0]()
    empty = {
        name: array[:0] if array.ndim == 2 and form != "efficient-nms" else array[:, :0]
        for name, array in outputs.items()
        if name != "num_dets"
    } | ({"num_dets": np.zeros((1, 1), np.int32)} if form == "efficient-nms" else {})
    detector = ModalityDetector(write_constant_network(tmp_path / "none.onnx", empty))
    assert detector.title == f"none.onnx ({form})"
    assert len(detector.detect(IMAGE)) == 0


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
    ("outputs", "metadata", "expected", "found"),
    [
        ({"a": (1, 7)}, {}, "outputs of a known form: trifuse, detr", "a (1, 7)"),
        ({"a": (1, 3, 4, 4)}, {}, "outputs of a known form: trifuse", "a (1, 3, 4, 4)"),
        (
            {"output0": (1, 84, CELLS), "output1": (1, 9, 9)},
            {},
            "outputs of a known form",
            f"output0 (1, 84, {CELLS}), output1 (1, 9, 9)",
        ),
        ({"output0": (1, 7, CELLS)}, {}, "classes by the names car, van, truck", "3 classes"),
        (
            {"output0": (1, 6, CELLS)},
            {"names": "['sofa', 'lamp']"},
            "classes by the names car, van, truck",
            "sofa, lamp",
        ),
        (
            {"output0": (1, 84, CELLS)},
            {"names": "['car', 'van']"},
            "scores of 2 classes: car, van",
            f"scores of 80 in output0 (1, 84, {CELLS}), read as ultralytics",
        ),
        (
            {"output0": (1, 4 + 3 + 51, CELLS)},
            {"names": str([*map(str, range(30))]), "kpt_shape": "[17, 3]"},
            "scores of 30 classes: 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19 and 10 more",
            "scores of 3 in output0",
        ),
        (
            {"output0": (1, 20, CELLS), "output1": (1, 32, 16, 24)},
            {},
            "outputs of the form ultralytics: (1, 4 + S, K)",
            f"output0 (1, 20, {CELLS}), output1 (1, 32, 16, 24)",
        ),
        (
            {
                "num_dets": (1, 1),
                "det_boxes": (1, 9, 4),
                "det_scores": (1, 8),
                "det_classes": (1, 8),
            },
            {},
            "outputs of the form efficient-nms: num_dets (1, 1), det_boxes (1, K, 4)",
            "num_dets (1, 1), det_boxes (1, 9, 4), det_scores (1, 8)",
        ),
        (
            {"logits": (1, 9, 80), "pred_boxes": (1, 8, 4)},
            {},
            "outputs of the form detr-sigmoid: logits (1, K, S), pred_boxes (1, K, 4)",
            "logits (1, 9, 80), pred_boxes (1, 8, 4)",
        ),
        (
            {"boxes": (9, 4), "labels": (8,), "scores": (9,)},
            {},
            "outputs of the form torchvision: boxes (K, 4), labels, scores (K)",
            "boxes (9, 4), labels (8,), scores (9,)",
        ),
        (
            {"output0": (1, 20, CELLS)},
            {"task": "obb", "names": str([*"abcdefghijklmno"])},
            "a detector of boxes along rows and columns",
            "task obb in its metadata",
        ),
    ],
)
def test_networks_that_are_no_known_detector(tmp_path, outputs, metadata, expected, found):
    arrays = {
        name: np.full(shape, 8 if name == "num_dets" else 0, np.float32)
        for name, shape in outputs.items()
    }
    path = write_constant_network(tmp_path / "other.onnx", arrays, metadata=metadata)
    with fault(ModelError, where="other.onnx", expected=expected, found=found):
        ModalityDetector(path)


# Others read any table with enough columns: further ones are coefficients of masks, or keypoints.
READ_ANY_TABLE = ("yolo", "yolox", "ultralytics-end-to-end")


@pytest.mark.parametrize("form", [name for name in OUTPUT_FORMS if name not in READ_ANY_TABLE])
def test_a_stated_form_that_the_outputs_do_not_have(write, form):
    path = write("yolo")
    path.with_suffix(".yaml").write_text(f"output: {form}")
    with pytest.raises(ModelError) as error:
        ModalityDetector(path)
    assert error.value.where == "public.onnx"
    assert f"(1, {3 * CELLS}, 85)" in error.value.found or error.value.found.endswith(" classes")


def test_bad_metadata_are_overruled_by_a_description(write):
    path = write("ultralytics", metadata={"names": "car, van"})
    with fault(ModelError, "public.onnx, metadata names", found="car, van", advice="class_names"):
        ModalityDetector(path)
    path.with_suffix(".yaml").write_text(f"class_names: {list(COCO_CLASSES)}")
    assert len(ModalityDetector(path).detect(IMAGE)) == 2


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
