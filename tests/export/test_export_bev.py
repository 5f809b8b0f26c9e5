"""A checkpoint of the bird's-eye view becomes a file that finds the same boxes, in 8 bits too."""

import json

import numpy as np
import onnx
import pytest
import torch

from data.open_drive import open_drive
from data.synthetic.collection import SynthConfig, write_drives
from export.bev import QUANTIZATION, exportable_bev, random_maps
from export.bev_graph import streamlined
from export.onnx import to_onnx
from export.quantize import to_int8
from perception.cli.main import main
from perception.detection.bev.bev_map import CHANNELS, BevGrid
from perception.detection.bev.boxes import MIN_LOGIT
from perception.detection.bev.detector import BevDetector
from perception.detection.onnx_model import OnnxModel
from perception.errors import ModelError, UsageError
from perception.sensor import VLP_16
from tests.faults import command, fault
from train.bev.networks import BevNetworkConfig
from train.networks.bev_centers import BevCenters

CONFIG = BevNetworkConfig(BevGrid(reach_m=25.6, cell_m=0.4), ("Car", "Truck"))


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    """Return what training writes, with scores all over the place."""
    torch.manual_seed(0)
    network = BevCenters(CONFIG.class_names, CHANNELS)
    maps = torch.from_numpy(
        random_maps((2, 32, 32, 16, CHANNELS), np.random.default_rng(1))["maps"]
    )
    with torch.no_grad():
        for _ in range(10):
            network.train()(maps)
        network.score_head[-1].bias.zero_()
    stated = {"model": "bev", **CONFIG.metadata, "training_data": "a street", "revision": "0123abc"}
    weights = {f"network.{name}": weight for name, weight in network.state_dict().items()}
    path = tmp_path_factory.mktemp("checkpoint") / "bev.ckpt"
    torch.save({"epoch": 2, "hyper_parameters": stated, "state_dict": weights}, path)
    return path


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    synth_config = SynthConfig(layout="object", frames=2, sensor=VLP_16, seed=4, images=False, street="jam")  # fmt: skip
    [folder] = write_drives(tmp_path_factory.mktemp("drive"), synth_config)
    return folder


def test_a_file_is_compared_with_its_checkpoint_on_a_drive(checkpoint, drive, tmp_path, capsys):
    out = tmp_path / "bev.onnx"
    assert main(f"export {checkpoint} --out {out} --data {drive} --int8".split()) == 0
    report = json.loads(out.with_suffix(".json").read_text())
    for kind in ("noise", "maps"):
        largest = report["variants"]["fp32"]["parity"][kind]["largest"]
        assert largest["scores"] < 1e-3
        assert largest["boxes"] < 0.01
    assert report["metadata"]["epochs"] == "3"
    precision = {name: one["precision"] for name, one in report["variants"].items()}
    assert precision["fp32"] == precision["torch"]
    assert set(precision["int8"]) <= {"Car", "Truck"}
    other = {"fp32": "bev.int8.onnx", "int8": "bev.fp32.onnx"}[report["choice"]["variant"]]
    assert {path.name for path in tmp_path.glob("*.onnx")} == {"bev.onnx", other}
    nodes = onnx.load(out if other == "bev.fp32.onnx" else tmp_path / other).graph.node
    # Maps are multiplied as they are.
    assert {node.op_type for node in nodes} >= {"Gemm", "QuantizeLinear"}
    assert "Cast" not in {node.op_type for node in nodes}
    assert "average precision" in capsys.readouterr().out


def test_a_file_finds_boxes_that_stand_on_the_ground(checkpoint, drive, tmp_path):
    file = tmp_path / "bev.onnx"
    file.write_bytes(to_onnx(exportable_bev(checkpoint)))
    detector = BevDetector(file, VLP_16, threads=1)
    assert detector.class_names == ("Car", "Truck")
    points_velo = open_drive(drive)[0].points_velo
    found = detector.detect(points_velo)
    above = detector.postprocess(detector.model({"maps": detector.preprocess(points_velo)}))
    assert len(found) > 0
    assert np.array_equal(found.scores, above.scores)
    lowered = above.boxes.bottom_m[:, 2] - found.boxes.bottom_m[:, 2]
    assert np.median(lowered) == pytest.approx(VLP_16.height_m, abs=0.3)


@pytest.mark.parametrize("rows", [1, 2])
@pytest.mark.parametrize("kind", ["fp32", "int8"])
def test_boxes_where_a_score_counts_are_those_of_the_whole_map(checkpoint, tmp_path, kind, rows):
    maps = random_maps((rows, 32, 32, 16, CHANNELS), np.random.default_rng(3))
    model = to_onnx(exportable_bev(checkpoint))
    model = model if kind == "fp32" else to_int8(model, [maps], QUANTIZATION)
    files = tmp_path / "whole.onnx", tmp_path / "part.onnx"
    for file, content in zip(files, (model, streamlined(model)), strict=True):
        file.write_bytes(content)
    whole, part = (OnnxModel(file, threads=1)(maps) for file in files)
    assert np.array_equal(part["scores"], whole["scores"])
    blocks, counts = part["blocks"], (whole["scores"] >= MIN_LOGIT).any(axis=1).ravel()
    assert blocks[0] == 0
    assert np.array_equal(blocks[1:], np.flatnonzero(counts))
    boxes = np.moveaxis(whole["boxes"], 1, 0).reshape(64, -1)[:, blocks]
    assert part["boxes"][0, :, 0] == pytest.approx(boxes, abs=1e-4)
    if rows == 1:
        found, expected = (
            BevDetector(file, VLP_16, threads=1).postprocess(outputs)
            for file, outputs in zip(files, (part, whole), strict=True)
        )
        assert len(found) > 10
        assert np.array_equal(found.scores, expected.scores)
        assert found.boxes.bottom_m == pytest.approx(expected.boxes.bottom_m, abs=1e-4)


def test_what_a_map_has_not_is_refused(checkpoint, tmp_path):
    with fault(UsageError, where="size", expected="none, as a map has one size"):
        command("export", checkpoint, "--out", tmp_path / "bev.onnx", "--size", "64x96")
    content = torch.load(checkpoint)
    content["hyper_parameters"]["classes"] = "Car,Ship"
    other = tmp_path / "other.ckpt"
    torch.save(content, other)
    with fault(ModelError, expected="hyperparameters of a bev", found="some of Car, Van, Truck"):
        exportable_bev(other)
