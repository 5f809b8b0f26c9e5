"""A detector of one modality says where in a picture of any size its objects are, or what does not fit."""

import numpy as np
import pytest

from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.network_input import (
    PixelRectangle,
    jpeg_compressed,
    place,
    prepare_image,
)
from perception.errors import ImageError, ModelError
from tests.detection.bright_cells import bright_cells


@pytest.fixture
def write(tmp_path):
    def write(name="bright.onnx", *words, **options):
        path = tmp_path / name
        path.write_bytes(bright_cells(*words, **options))
        return path

    return write


def image_with_bright_cells(channels=1, cells=(((0, 0), 204), ((1, 2), 102))):
    """Return a picture of 64 x 96 whose cells (row, column) are as bright as told."""
    image = np.zeros((64, 96, channels), np.uint8)
    for (row, column), brightness in cells:
        image[32 * row : 32 * row + 32, 32 * column : 32 * column + 32] = brightness
    return image


@pytest.mark.parametrize(("modality", "channels"), [("rgb", 3), ("dm", 1), ("rm", 1)])
def test_bright_cells_are_found_best_first(write, modality, channels):
    found = ModalityDetector(write("a.onnx", modality)).detect(image_with_bright_cells(channels))
    # The last pixels of the picture are at 95 and 63.
    np.testing.assert_allclose(found.boxes_px, [[0, 0, 32, 32], [64, 32, 95, 63]])
    np.testing.assert_allclose(found.scores, [0.8, 0.4], rtol=1e-6)
    assert found.types.tolist() == ["Car", "Car"]


@pytest.mark.parametrize(("fit", "across"), [("letterbox", 3), ("stretch", 5)])
def test_boxes_are_in_pixels_of_the_given_image(write, fit, across):
    large = image_with_bright_cells().repeat(3, axis=0).repeat(across, axis=1)
    found = ModalityDetector(write(fit=fit)).detect(large)
    right, width = 32 * across, 96 * across
    np.testing.assert_allclose(found.boxes_px, [[0, 0, right, 96], [2 * right, 96, width - 1, 191]])
    np.testing.assert_allclose(found.scores, [0.8, 0.4], rtol=1e-6)


def test_a_black_image_has_no_detection(write):
    assert len(ModalityDetector(write()).detect(np.full((64, 96, 1), 2, np.uint8))) == 0


def test_channels_are_not_mixed_up(write):
    image = np.zeros((64, 96, 3), np.uint8)
    image[..., 0], image[..., 2] = 30, 90
    shown = ModalityDetector(write("a.onnx", "rgb")).preprocess(image)
    assert shown.shape == (1, 3, 64, 96)
    assert shown.dtype == np.uint8
    np.testing.assert_array_equal(shown[0, :, 5, 7], [30, 0, 90])


def test_a_network_of_compressed_images_runs_on_compressed_images(write):
    image = np.random.default_rng(0).integers(0, 256, (64, 96, 1), dtype=np.uint8)
    plain, compressed = ModalityDetector(write()), ModalityDetector(write(jpeg_quality="10"))
    assert (plain.jpeg_quality, compressed.jpeg_quality) == (None, 10)
    np.testing.assert_array_equal(plain.preprocess(image)[0, 0], image[..., 0])
    expected = jpeg_compressed(image, 10)[..., 0]
    assert np.abs(expected.astype(int) - image[..., 0]).max() > 20
    np.testing.assert_array_equal(compressed.preprocess(image)[0, 0], expected)
    assert plain.detect(image).scores.tolist() != compressed.detect(image).scores.tolist()


def test_compression_comes_before_the_size(write):
    image = np.random.default_rng(0).integers(0, 256, (375, 1242, 3), dtype=np.uint8)
    detector = ModalityDetector(write("a.onnx", "rgb", jpeg_quality="75"))
    placement = place(PixelRectangle.whole(image), detector.size)
    expected = prepare_image(jpeg_compressed(image, 75), "rgb", placement)
    np.testing.assert_array_equal(detector.preprocess(image)[0], expected.transpose(2, 0, 1))


def test_each_class_is_found_by_itself(write):
    detector = ModalityDetector(write("a.onnx", "dm", "Car,Pedestrian"))
    found = detector.detect(image_with_bright_cells())
    assert sorted(found.types.tolist()) == ["Car", "Car", "Pedestrian", "Pedestrian"]


def test_file_says_what_it_is(write):
    detector = ModalityDetector(
        write("a.onnx", "rm", "Car,Van", (32, 96), filling="sparse", revision="0123abc")
    )
    assert detector.modality == "rm"
    assert detector.class_names == ("Car", "Van")
    assert detector.size == InputSize(height_px=32, width_px=96)
    assert detector.filling == "sparse"
    assert detector.metadata["revision"] == "0123abc"


def test_output_does_not_depend_on_threads(write):
    image = np.random.default_rng(0).integers(0, 256, (375, 1242, 1), dtype=np.uint8)
    one, two = (ModalityDetector(write(), threads).detect(image) for threads in (1, 2))
    np.testing.assert_array_equal(one.scores, two.scores)
    np.testing.assert_array_equal(one.boxes_px, two.boxes_px)


@pytest.mark.parametrize(
    ("options", "expected", "found"),
    [
        ({"kind": "depthcn"}, "kind detector", "depthcn"),
        ({"modality": "sonar"}, "modality rgb or dm or rm", "sonar"),
        ({"filling": "guess"}, "filling sparse or default", "guess"),
        ({"input_height": "tall"}, "input_height in pixels", "tall"),
        ({"input_width": "0"}, "input_width in pixels", "0"),
        ({"input_width": "640"}, "input uint8 any x 1 x 64 x 640", "uint8 any x 1 x 64 x 96"),
        ({"jpeg_quality": "fine"}, "jpeg_quality from 1 to 100", "fine"),
        ({"jpeg_quality": "0"}, "jpeg_quality from 1 to 100", "0"),
        ({"planes": 3}, "input uint8 any x 1 x 64 x 96", "uint8 any x 3 x 64 x 96"),
        ({"output_classes": 2}, "scores of 1 classes: Car", "scores of 2"),
        ({"divisor": 0.0}, "finite numbers in output scores", "6 that are NaN or infinite"),
    ],
)
def test_file_that_contradicts_itself_or_the_detector(write, options, expected, found):
    with pytest.raises(ModelError) as error:
        ModalityDetector(write(**options))
    assert error.value.where == "bright.onnx"
    assert error.value.expected.startswith(expected)
    assert error.value.found.startswith(found)


def test_broken_and_missing_file(write, tmp_path):
    path = write()
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ModelError) as error:
        ModalityDetector(path)
    assert error.value.where.endswith("bright.onnx")
    with pytest.raises(ModelError) as error:
        ModalityDetector(tmp_path / "gone.onnx")
    assert (error.value.where, error.value.expected) == ("gone.onnx", "a model file")


@pytest.mark.parametrize("shape", [(64, 96, 1), (64, 96), (0, 96, 3)])
def test_image_of_another_modality(write, shape):
    with pytest.raises(ImageError) as error:
        ModalityDetector(write("a.onnx", "rgb")).detect(np.zeros(shape, np.uint8))
    assert error.value.expected == "shape (H, W, 3) of modality rgb"
    assert error.value.found == f"shape {shape}"
