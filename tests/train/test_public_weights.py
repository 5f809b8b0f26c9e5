"""The public weights of YOLOX-nano, where their file lies; it is no part of this project."""

import os
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from perception.errors import ModelError
from tests.faults import fault
from train.detector.initial_network import init_from_public, public_detector
from train.networks.yolox import YoloxNano, flatten_levels

_DEFAULT = Path(__file__).parents[3] / "shared" / "public_networks"
CAR, BUS, TRUCK = 2, 5, 7


@pytest.fixture(scope="module")
def public_file():
    path = Path(os.environ.get("PUBLIC_NETWORKS", _DEFAULT)) / "yolox_nano.onnx"
    if not path.is_file():
        pytest.skip(f"no {path}: set PUBLIC_NETWORKS to the folder of the public networks")
    return path


def public_outputs(path, images):
    """Return what ONNX Runtime computes of RGB images, (B, K, 85), at any size."""
    model = onnx.load(path)
    sides = model.graph.input[0].type.tensor_type.shape.dim
    for side, length in zip(sides[2:], images.shape[2:], strict=True):
        side.dim_value = length
    model.graph.output[0].type.tensor_type.shape.dim[1].dim_param = "boxes"
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    session = onnxruntime.InferenceSession(model.SerializeToString(), options)
    return session.run(None, {"images": images[:, ::-1].astype(np.float32)})[0]


@pytest.mark.parametrize("size", [(416, 416), (192, 640)])
def test_our_module_computes_what_the_file_does(public_file, size):
    rng = np.random.default_rng(0)
    coarse = rng.integers(0, 256, (1, 3, *(side // 16 for side in size)), dtype=np.uint8)
    images = coarse.repeat(16, axis=2).repeat(16, axis=3)
    expected = torch.from_numpy(public_outputs(public_file, images))
    with torch.inference_mode():
        flat = flatten_levels(public_detector(public_file)(torch.from_numpy(images)))
    assert torch.allclose(flat[..., :4], expected[..., :4], atol=1e-3)
    assert torch.allclose(flat[..., 4:].sigmoid(), expected[..., 4:], atol=1e-4)
    assert expected[..., 4].max() > 0.05  # something is there to compare


def test_classes_start_from_those_that_are_like_them(public_file):
    public, ours = public_detector(public_file), YoloxNano(("car", "Truck", "Tram"))
    fresh = ours.head.levels[0].classes.weight.detach().clone()
    init_from_public(ours, public_file)
    found = ours.head.levels[0].classes.weight
    coco = public.head.levels[0].classes.weight
    assert torch.equal(found[0], coco[CAR])
    assert torch.allclose(found[1], (coco[BUS] + coco[TRUCK]) / 2)
    assert torch.equal(found[2], fresh[2])
    assert torch.equal(ours.trunk.stem[0].weight, public.trunk.stem[0].weight)


def test_another_file_is_refused(tmp_path):
    other = tmp_path / "yolox_nano.onnx"
    other.write_bytes(b"other")
    with fault(ModelError, str(other), "SHA-256 695e750a5d57", "d9298a10d1b0", "fetch https://"):
        public_detector(other)


def test_a_missing_file_is_named(tmp_path):
    with fault(ModelError, "none.onnx", "public weights of YOLOX-nano", "No such file", "fetch"):
        public_detector(tmp_path / "none.onnx")
