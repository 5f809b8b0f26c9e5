"""A file offers what was asked for, whatever the number of rows, and nothing of who wrote it."""

import numpy as np
import onnx
import pytest
import torch

from export.onnx import OPSET, Exportable, to_onnx
from export.variants import Parity, compare, torch_runner
from perception.detection.onnx_model import ModelContract, ModelInput, OnnxModel
from perception.errors import ModelError
from tests.faults import fault


class Doubled(torch.nn.Module):
    """Two outputs of two inputs."""

    def __init__(self):
        super().__init__()
        self.register_buffer("two", torch.tensor(2.0))

    def forward(self, images, places):
        return images.float().mean((1, 2)) * self.two, places - 1


EXPORTABLE = Exportable(
    Doubled(),
    {"images": torch.zeros(2, 3, 5, dtype=torch.uint8), "places": torch.zeros(2, 4)},
    outputs=("bright", "moved"),
    metadata={"kind": "doubled", "classes": "Car,Van"},
)
CONTRACT = ModelContract(
    EXPORTABLE.metadata,
    inputs={
        "images": ModelInput(np.uint8, (None, 3, 5)),
        "places": ModelInput(np.float32, (None, 4)),
    },
    outputs=EXPORTABLE.outputs,
)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "doubled.onnx"
    path.write_bytes(to_onnx(EXPORTABLE))
    return path


def batch_of(rows):
    generator = np.random.default_rng(rows)
    return {
        "images": generator.integers(0, 256, (rows, 3, 5), dtype=np.uint8),
        "places": generator.normal(size=(rows, 4)).astype(np.float32),
    }


@pytest.mark.parametrize("rows", [0, 1, 2, 9])
def test_the_file_computes_as_the_module(file, rows):
    batch = batch_of(rows)
    outputs = OnnxModel(file, CONTRACT)(batch)
    assert outputs["bright"].shape == (rows,)
    if rows:
        means = 2 * batch["images"].mean(axis=(1, 2))
        np.testing.assert_allclose(outputs["bright"], means, rtol=1e-6)
    np.testing.assert_array_equal(outputs["moved"], batch["places"] - 1)


def test_file_says_what_it_is_and_not_where_it_was_made(file):
    model = onnx.load(file)
    assert {entry.key: entry.value for entry in model.metadata_props} == EXPORTABLE.metadata
    assert [opset.version for opset in model.opset_import if not opset.domain] == [OPSET]
    assert b"test_onnx_file" not in file.read_bytes()
    assert not any(node.metadata_props or node.doc_string for node in model.graph.node)


def test_same_network_gives_the_same_file(file):
    assert to_onnx(EXPORTABLE) == file.read_bytes()


def test_module_that_takes_only_its_example_is_refused():
    class Fixed(torch.nn.Module):
        def forward(self, images):
            return torch.ones(1).expand(len(images))

    example = {"images": torch.zeros(2, 3, dtype=torch.uint8)}
    with fault(ModelError, expected="any length of axis 0 of input images"):
        to_onnx(Exportable(Fixed(), example, ("flat",), {}))


def test_parity_is_the_largest_difference_of_any_batch():
    def shifted(batch):
        outputs = dict(torch_runner(EXPORTABLE)(batch))
        outputs["moved"] = outputs["moved"] + 0.25 * (len(batch["places"]) == 3)
        return outputs

    parity = compare(torch_runner(EXPORTABLE), shifted, [batch_of(0), batch_of(3), batch_of(2)])
    assert parity == Parity(5, {"bright": 0.0, "moved": 0.25})
    parity.require({"bright": 0.0, "moved": 0.25}, "doubled.onnx")
    with fault(ModelError, "doubled.onnx", "moved within 0.2", "0.25 on 5"):
        parity.require({"bright": 0.0, "moved": 0.2}, "doubled.onnx")


def test_output_of_another_shape_is_no_parity():
    def halved(batch):
        return {name: array[::2] for name, array in torch_runner(EXPORTABLE)(batch).items()}

    with fault(ModelError, "output bright", "shape (4,)", "(2,)"):
        compare(torch_runner(EXPORTABLE), halved, [batch_of(4)])


def test_difference_that_is_not_a_number_is_refused():
    def broken(batch):
        return {
            name: np.full_like(array, np.nan)
            for name, array in torch_runner(EXPORTABLE)(batch).items()
        }

    parity = compare(torch_runner(EXPORTABLE), broken, [batch_of(4)])
    with fault(ModelError, found="a difference of nan"):
        parity.require({"bright": 1.0, "moved": 1.0}, "doubled.onnx")
