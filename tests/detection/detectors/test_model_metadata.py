"""Names of classes and keypoints in the metadata of ONNX files."""

import subprocess
import sys

import pytest

from perception.detection.detectors.model_metadata import class_names, keypoint_columns
from perception.errors import ModelError
from tests.faults import fault


@pytest.mark.parametrize(
    "text",
    [
        "{0: 'car', 1: \"driver's van\"}",
        "['car', \"driver's van\"]",
        "('car', \"driver's van\")",
        '{"0": "car", "1": "driver\'s van"}',
        '["car", "driver\'s van"]',
    ],
)
def test_names_in_python_and_json(text):
    assert class_names({"names": text}, "a.onnx") == {0: "car", 1: "driver's van"}


def test_a_file_without_names_and_keypoints():
    assert class_names({}, "a.onnx") == {}
    assert keypoint_columns({}, "a.onnx") == 0


@pytest.mark.parametrize(("text", "columns"), [("[17, 3]", 51), ("(4, 2)", 8)])
def test_keypoints(text, columns):
    assert keypoint_columns({"kpt_shape": text}, "a.onnx") == columns


@pytest.mark.parametrize(
    "text",
    [
        "",
        "car, van",
        "'car'",
        "{0: 'car'",
        "{0: 1}",
        "{'car': 0}",
        "{-1: 'car'}",
        "{0.5: 'car'}",
        "{0: 'car', '0': 'van'}",
        "{[]: 'car'}",
        "{1e999: 'car'}",
        "__import__('os').system('true')",
        "[" * 9000,
        "1" * 9000,
        "-" * 9000 + "1",
        "1+" * 9000 + "1",
        "['\\d']\0",
        "[" + "'car'," * 90_000 + "]",
    ],
)
def test_names_that_are_none(text, recwarn):
    with fault(ModelError, "a.onnx, metadata names", "a literal such as {0: 'car'", text[:60]):
        class_names({"names": text}, "a.onnx")
    assert not recwarn.list


@pytest.mark.parametrize("text", ["17", "[17]", "[17, 'x']", "[-1, 3]", "[99999, 3]", "{}"])
def test_keypoints_that_are_none(text):
    with fault(ModelError, "a.onnx, metadata kpt_shape", "a literal such as [17, 3]", text):
        keypoint_columns({"kpt_shape": text}, "a.onnx")


def test_names_with_backslashes_are_read_in_silence():
    code = (
        "from perception.detection.detectors.model_metadata import class_names\n"
        "print(class_names({'names': r\"['\\d']\"}, 'a.onnx'))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("{0: '\\\\d'}\n", "")
