"""Weights that are read back from a model file predict what the file does, and are trained on with a frozen normalisation."""

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from data.open_drive import open_drive
from data.synthetic.collection import SynthConfig, write_drives
from export.bev import exportable_bev, random_maps
from export.detector import DecodedDetector, random_images
from export.onnx import to_onnx
from perception.detection.bev.bev_map import CHANNELS, BevGrid
from perception.detection.bev.detector import BevDetector
from perception.detection.onnx_model import OnnxModel, shipped_model
from perception.errors import ModelError
from perception.sensor import VLP_16
from tests.faults import fault
from train.bev.networks import BevNetworkConfig, load_bev
from train.bev.training import BevTraining
from train.detector.config import InitialWeights
from train.detector.initial_network import initial_network
from train.detector.networks import DetectorNetworkConfig, load_detector
from train.networks.bev_centers import BevCenters

CONFIG = BevNetworkConfig(BevGrid(reach_m=25.6, cell_m=0.4), ("Car", "Truck"))
SHIPPED = Path(str(shipped_model("bev_centers")))


@pytest.fixture(scope="module")
def maps():
    made = random_maps((2, 32, 32, 16, CHANNELS), np.random.default_rng(1))["maps"]
    return torch.from_numpy(made)


@pytest.fixture(scope="module")
def checkpoint(maps, tmp_path_factory):
    """Return a checkpoint whose normalisation has seen something."""
    torch.manual_seed(0)
    network = BevCenters(CONFIG.class_names, CHANNELS)
    with torch.no_grad():
        for _ in range(10):
            network.train()(maps)
        network.score_head[-1].bias.zero_()
    stated = {"model": "bev", **CONFIG.metadata, "training_frames": "AAAAAAAAAAA="}
    weights = {f"network.{name}": weight for name, weight in network.state_dict().items()}
    path = tmp_path_factory.mktemp("checkpoint") / "bev.ckpt"
    torch.save({"epoch": 2, "hyper_parameters": stated, "state_dict": weights}, path)
    return path


@pytest.fixture(scope="module")
def exported(checkpoint):
    file = checkpoint.with_name("bev.onnx")
    file.write_bytes(to_onnx(exportable_bev(checkpoint)))
    return file


def test_a_file_in_full_precision_predicts_as_its_checkpoint(checkpoint, exported, maps):
    with torch.no_grad():
        expected, found = (load_bev(file)[0](maps) for file in (checkpoint, exported))
    assert torch.allclose(expected.scores, found.scores, atol=1e-4)
    assert torch.allclose(expected.boxes, found.boxes, atol=1e-4)
    assert load_bev(exported)[1]["classes"] == "Car,Truck"


def test_weights_of_8_bits_find_what_the_file_finds(tmp_path):
    config = SynthConfig(layout="object", frames=1, sensor=VLP_16, seed=4, images=False, street="jam")  # fmt: skip
    [folder] = write_drives(tmp_path, config)
    detector = BevDetector(SHIPPED, VLP_16)
    maps = detector.preprocess(open_drive(folder)[0].points_velo)
    network, metadata = load_bev(SHIPPED)
    with torch.no_grad():
        raw = network(torch.from_numpy(maps))
    names = ("scores", "boxes")
    outputs = {name: part.numpy() for name, part in zip(names, raw, strict=True)}
    expected = detector.postprocess(detector.model({"maps": maps}))
    found = detector.postprocess(outputs)
    assert metadata == dict(detector.model.metadata)
    sure = expected[expected.scores > 0.4].boxes.bottom_m
    assert len(sure) > 3
    gaps_m = np.linalg.norm(sure[:, None] - found.boxes.bottom_m[None], axis=2).min(axis=1)
    assert gaps_m.max() < 0.3
    best = min(5, len(found))
    assert found.scores[:best] == pytest.approx(expected.scores[:best], abs=0.1)


def test_folded_normalisation_is_not_trained_but_for_its_biases(exported, maps):
    training = BevTraining(classes=CONFIG.class_names, reach_m=25.6, cell_m=0.4, weights=exported)
    network = training.network
    norms = [one for one in network.modules() if isinstance(one, torch.nn.BatchNorm2d)]
    assert network.training
    assert not any(one.training for one in norms)
    before = [one.running_var.clone() for one in norms]
    network.train()(maps).scores.sum().backward()
    assert all(torch.equal(one.running_var, var) for one, var in zip(norms, before, strict=True))
    assert norms[0].bias.grad is not None
    assert training.hparams["training_frames"] == "AAAAAAAAAAA="
    # One with random weights has its own statistics.
    fresh = BevCenters(("Car",), CHANNELS).train()
    assert all(one.training for one in fresh.modules())


def test_other_files_are_refused(exported, tmp_path):
    with fault(ModelError, where="none.onnx", expected="a model file of bev", found="no such file"):
        load_bev(tmp_path / "none.onnx")
    damaged = tmp_path / "damaged.onnx"
    damaged.write_bytes(exported.read_bytes()[:2000])
    with fault(ModelError, where="damaged.onnx", found="a file that cannot be read"):
        load_bev(damaged)
    with fault(ModelError, where="rgb_yolox.onnx", expected="a model file of bev"):
        load_bev(SHIPPED.with_name("rgb_yolox.onnx"))
    model = onnx.load(exported)
    del model.graph.initializer[0]
    onnx.save(model, tmp_path / "part.onnx")
    with fault(ModelError, where="part.onnx", expected="weights of this bev", found="weight"):
        load_bev(tmp_path / "part.onnx")
    with fault(ModelError, expected="a bev whose cell_m is 0.2", found="0.4"):
        BevTraining(weights=exported)


def test_the_weights_of_the_camera_are_read_back():
    network, stated = load_detector(Path(str(shipped_model("rgb_yolox"))))
    assert stated["classes"] == "Car,Van,Truck,Pedestrian,Cyclist"
    images = random_images(1, (3, 64, 96), np.random.default_rng(2))
    with torch.no_grad():
        boxes_px, scores = DecodedDetector(network)(torch.from_numpy(images))
    expected = OnnxModel(shipped_model("rgb_yolox"), threads=1)({"images": images})
    np.testing.assert_allclose(boxes_px, expected["boxes_px"], atol=0.01)
    np.testing.assert_allclose(scores, expected["scores"], atol=1e-5)
    weights = InitialWeights(checkpoint=Path(str(shipped_model("rgb_yolox"))))
    config = DetectorNetworkConfig("rgb", ("Car",), network="yolox-nano")
    with fault(ModelError, "rgb_yolox.onnx", expected="a detector whose classes is Car"):
        initial_network(config, weights)


def test_batch_norm_of_a_detector_does_not_come_back():
    with fault(ModelError, "dm_compact.onnx", found="others (network: expected yolox-nano"):
        load_detector(Path(str(shipped_model("dm_compact"))))
