"""Inputs of networks: layouts, types, batches, and what stands beside the image."""

import numpy as np
import pytest
from onnx import TensorProto

from perception.detection.detectors.modality_detector import ModalityDetector
from perception.errors import ModelError
from tests.detection.public_forms import (
    CAR_PX,
    HEIGHT,
    IMAGE,
    TRUCK_PX,
    WIDTH,
    detr,
    efficient_nms,
    end_to_end,
    ultralytics,
    write_constant_network,
    write_network,
    yolo,
    yolov7_end_to_end,
)
from tests.faults import fault

COLOURS = np.full((HEIGHT, WIDTH, 3), [10, 20, 51], np.uint8)


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (TensorProto.FLOAT, [10 / 255, 20 / 255, 0.2]),
        (TensorProto.FLOAT16, [10 / 255, 20 / 255, 0.2]),
        (TensorProto.UINT8, [10, 20, 51]),
    ],
)
def test_types_and_layouts(tmp_path, kind, expected):
    channels_first = write_network(tmp_path / "first.onnx", "ultralytics", image_type=kind)
    shape = (1, HEIGHT, WIDTH, 3)
    channels_last = write_network(
        tmp_path / "last.onnx", "ultralytics", image_type=kind, image_shape=shape
    )
    first, last = (ModalityDetector(path) for path in (channels_first, channels_last))
    shown = last.preprocess(COLOURS)
    assert shown.shape == shape
    np.testing.assert_allclose(shown[0, 5, 7], expected, rtol=1e-3)
    np.testing.assert_array_equal(shown.transpose(0, 3, 1, 2), first.preprocess(COLOURS))
    np.testing.assert_allclose(last.detect(IMAGE).boxes_px, [CAR_PX, TRUCK_PX], atol=1e-4)


def test_channels_last_of_any_size(tmp_path):
    path = write_network(tmp_path / "any.onnx", "efficient-nms", image_shape=("n", "h", "w", 3))
    path.with_suffix(".yaml").write_text("input_size: 96x320")
    shown = ModalityDetector(path).preprocess(np.zeros((720, 1280, 3), np.uint8))
    assert shown.shape == (1, 128, 224, 3)


def test_a_fixed_size_with_channels_last_is_widened(tmp_path):
    path = write_network(tmp_path / "wide.onnx", "efficient-nms", image_shape=(1, HEIGHT, WIDTH, 3))
    path.with_suffix(".yaml").write_text("input_size: 96x320")
    shown = ModalityDetector(path).preprocess(np.zeros((375, 1242, 3), np.uint8))
    assert shown.shape == (1, 96, 320, 3)


@pytest.mark.parametrize(
    ("outputs", "options"),
    [
        (ultralytics, {}),
        (yolo, {}),
        (end_to_end, {}),
        (efficient_nms, {}),
        (detr, {"sizes": True}),
        (yolov7_end_to_end, {}),
    ],
)
def test_the_first_image_of_a_batch_is_read(tmp_path, outputs, options):
    of_batch = {
        name: np.concatenate([array, np.full_like(array, 0.9)]) if len(array) == 1 else array
        for name, array in outputs().items()
    }
    shape = (2, 3, HEIGHT, WIDTH)
    path = write_constant_network(tmp_path / "two.onnx", of_batch, shape, **options)
    detector = ModalityDetector(path)
    shown = detector.preprocess(COLOURS)
    assert shown.shape == shape
    np.testing.assert_array_equal(shown[0], shown[1])
    found = detector.detect(IMAGE)
    np.testing.assert_allclose(found.boxes_px, [CAR_PX, TRUCK_PX], atol=1e-4)
    assert found.types.tolist() == ["Car", "Truck"]


@pytest.mark.parametrize(
    ("shape", "kind", "found"),
    [
        ((1, HEIGHT, WIDTH, 4), TensorProto.FLOAT, "images float32 1 x 64 x 96 x 4"),
        ((1, 3, HEIGHT, WIDTH), TensorProto.INT64, "images int64 1 x 3 x 64 x 96"),
        ((1, 3, HEIGHT, WIDTH), TensorProto.DOUBLE, "images another type 1 x 3 x 64 x 96"),
        ((3, HEIGHT), TensorProto.FLOAT, "images float32 3 x 64"),
        ((9**9, 3, HEIGHT, WIDTH), TensorProto.FLOAT, "images float32 387420489 x 3 x 64 x 96"),
    ],
)
def test_inputs_that_are_no_image(tmp_path, shape, kind, found):
    path = write_network(tmp_path / "rows.onnx", "yolox", image_shape=shape, image_type=kind)
    expected = "one image (batch, 3, height, width) or (batch, height, width, 3) of uint8"
    with fault(ModelError, where="rows.onnx", expected=expected, found=found):
        ModalityDetector(path)


@pytest.mark.parametrize("outputs", [ultralytics, end_to_end, efficient_nms])
def test_outputs_of_half_precision(tmp_path, outputs):
    halves = {
        name: array.astype(np.float16) if array.dtype == np.float32 else array
        for name, array in outputs().items()
    }
    path = write_constant_network(tmp_path / "half.onnx", halves, image_type=TensorProto.FLOAT16)
    found = ModalityDetector(path).detect(IMAGE)
    np.testing.assert_allclose(found.boxes_px, [CAR_PX, TRUCK_PX], atol=0.1)
    np.testing.assert_allclose(found.scores, [0.8, 0.5], atol=1e-3)
