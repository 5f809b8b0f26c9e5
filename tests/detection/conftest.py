"""A network so small that its answer is known: the brighter a crop, the likelier a vehicle."""

from collections.abc import Callable
from pathlib import Path

import onnx
import pytest
from onnx import TensorProto, helper

METADATA = {
    "kind": "depthcn",
    "method": "default",
    "window": "box",
    "channels": "depth,height,reflectance",
    "classes": "Car",
    "input_height": "66",
    "input_width": "112",
}


def bright_is_likely(
    metadata: dict[str, str] = METADATA,
    *,
    divisor: float = 255.0,
    planes: int = 3,
    input_type: int = 2,
    by_plane: bool = False,
) -> bytes:
    """Return a file of: scores = mean of the crop, or of each plane of it / divisor, boxes_px = windows_px."""
    axes = [2, 3] if by_plane else [1, 2, 3]
    score_shape = ["M", planes] if by_plane else ["M"]
    nodes = [
        helper.make_node("Cast", ["crops"], ["numbers"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMean", ["numbers", "axes"], ["means"], keepdims=0),
        helper.make_node("Div", ["means", "divisor"], ["scores"]),
        helper.make_node("Identity", ["windows_px"], ["boxes_px"]),
    ]
    graph = helper.make_graph(
        nodes,
        "bright_is_likely",
        [
            helper.make_tensor_value_info("crops", input_type, ["M", planes, 66, 112]),
            helper.make_tensor_value_info("windows_px", TensorProto.FLOAT, ["M", 4]),
        ],
        [
            helper.make_tensor_value_info("scores", TensorProto.FLOAT, score_shape),
            helper.make_tensor_value_info("boxes_px", TensorProto.FLOAT, ["M", 4]),
        ],
        [
            helper.make_tensor("axes", TensorProto.INT64, [len(axes)], axes),
            helper.make_tensor("divisor", TensorProto.FLOAT, [], [divisor]),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model)
    return model.SerializeToString()


@pytest.fixture
def write_model(tmp_path) -> Callable[..., Path]:
    """Return a function that writes such a network, with facts changed, and returns its path."""

    def write(name: str = "tiny.onnx", without: str = "", **options) -> Path:
        changes = {key: options.pop(key) for key in list(options) if key in METADATA}
        metadata = {key: value for key, value in (METADATA | changes).items() if key != without}
        path = tmp_path / name
        path.write_bytes(bright_is_likely(metadata, **options))
        return path

    return write
