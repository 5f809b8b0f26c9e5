"""ONNX files of strangers: nothing beside them is read, and nothing of theirs runs but known operators."""

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from perception.detection.onnx_content import has_external_data
from perception.detection.onnx_model import OnnxModel, shipped_model
from perception.errors import ModelError
from tests.faults import fault


def model_of(nodes, tensors=(), domain=""):
    entries = [helper.make_tensor_value_info(name, TensorProto.FLOAT, [4]) for name in "xy"]
    graph = helper.make_graph(nodes, "g", entries[:1], entries[1:], tensors)
    opsets = [helper.make_opsetid("", 17), helper.make_opsetid(domain or "ai.onnx.ml", 1)]
    return helper.make_model(graph, opset_imports=opsets, ir_version=9)


def tensor_elsewhere(location):
    tensor = TensorProto(name="w", data_type=TensorProto.FLOAT, dims=[4])
    tensor.data_location = TensorProto.EXTERNAL
    for key, value in (("location", location), ("offset", "0"), ("length", "16")):
        tensor.external_data.add(key=key, value=value)
    return tensor


ADD = helper.make_node("Add", ["x", "w"], ["y"])


def of_initializer(location):
    return model_of([ADD], [tensor_elsewhere(location)])


def of_constant(location):
    constant = helper.make_node("Constant", [], ["w"], value=tensor_elsewhere(location))
    return model_of([constant, ADD])


def of_subgraph(location):
    out = helper.make_tensor_value_info("z", TensorProto.FLOAT, [4])
    constant = helper.make_node("Constant", [], ["z"], value=tensor_elsewhere(location))
    branch = helper.make_graph([constant], "b", [], [out])
    choice = helper.make_node("If", ["c"], ["y"], then_branch=branch, else_branch=branch)
    return model_of([choice], [numpy_helper.from_array(np.array(True), "c")])


@pytest.mark.parametrize("make", [of_initializer, of_constant, of_subgraph])
@pytest.mark.parametrize("location", ["weights.bin", "../weights.bin", "/etc/passwd", "link.bin"])
def test_a_model_reads_no_other_file(make, location, tmp_path, monkeypatch):
    (tmp_path / "models").mkdir()
    for folder in (tmp_path, tmp_path / "models"):
        (folder / "weights.bin").write_bytes(bytes(16))
    (tmp_path / "models/link.bin").symlink_to("/etc/passwd")
    monkeypatch.chdir(tmp_path / "models")
    path = tmp_path / "models/stranger.onnx"
    path.write_bytes(make(location).SerializeToString())
    with fault(ModelError, where=str(path), found="tensors in files beside it", advice="one file"):
        OnnxModel(path)


def test_operators_of_strangers_do_not_run(tmp_path):
    path = tmp_path / "stranger.onnx"
    nodes = [helper.make_node("Own", ["x"], ["y"], domain="stranger")]
    path.write_bytes(model_of(nodes, domain="stranger").SerializeToString())
    with fault(ModelError, where=str(path), expected="a complete ONNX model"):
        OnnxModel(path)


def test_a_tensor_that_states_a_huge_shape_is_refused(tmp_path):
    huge = TensorProto(name="w", data_type=TensorProto.FLOAT, dims=[1 << 20, 1 << 20])
    huge.raw_data = bytes(16)
    path = tmp_path / "stranger.onnx"
    path.write_bytes(model_of([ADD], [huge]).SerializeToString())
    with fault(ModelError, where=str(path), expected="a complete ONNX model"):
        OnnxModel(path)


@pytest.mark.parametrize("name", ["rgb_yolox", "depthcn_default"])
def test_networks_that_ship_are_whole(name):
    content = shipped_model(name).read_bytes()
    assert not has_external_data(content)
    assert onnx.load_from_string(content).graph.initializer


@pytest.mark.parametrize(
    "content", [b"text", b"\x3a\xff\xff\xff\xff\x0f", b"\x80" * 20, b"\x3b", b"\x3a\x05\x0a"]
)
def test_what_is_no_message_is_said(content):
    with pytest.raises(ValueError, match="no message of Protobuf"):
        has_external_data(content)


def test_graphs_without_end_are_refused():
    graph = b""
    for _ in range(100):  # a node with an attribute with a graph with ...
        for tag in (0x32, 0x2A, 0x0A):
            length = len(graph)
            size = bytes([length & 0x7F | 0x80, length >> 7]) if length > 0x7F else bytes([length])
            graph = bytes([tag]) + size + graph
    with pytest.raises(ValueError, match="too deep"):
        has_external_data(b"\x3a" + bytes([len(graph) & 0x7F | 0x80, len(graph) >> 7]) + graph)
