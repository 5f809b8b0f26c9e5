"""Small networks with the inputs and outputs of public detectors: outputs that do not depend on the image.

Their first output also holds 0 times the mean of the image, so that the image is an input of the graph.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper


def write_constant_network(
    path: Path,
    outputs: Mapping[str, np.ndarray],
    image_shape: tuple[int | str, ...] = (1, 3, 64, 96),
    *,
    sizes: bool = False,
    mask: bool = False,
    metadata: Mapping[str, str] | None = None,
    image_type: int = TensorProto.FLOAT,
) -> Path:
    """Write a network that returns arrays, whatever the image.

    `sizes` adds the input `orig_target_sizes`, whose width and height scale the `boxes` of 0 to 1; `mask` the input
    `pixel_mask`, without which the first output is less.
    """
    inputs = [helper.make_tensor_value_info("images", image_type, image_shape)]
    nodes = [
        helper.make_node("Cast", ["images"], ["numbers"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMean", ["numbers"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "zero"], ["nothing"]),
    ]
    constants = [numpy_helper.from_array(np.float32(0), "zero")]
    if mask:
        inputs.append(helper.make_tensor_value_info("pixel_mask", TensorProto.INT64, [1, 64, 64]))
        nodes[1:1] = [
            helper.make_node("Cast", ["pixel_mask"], ["shown"], to=TensorProto.FLOAT),
            helper.make_node("ReduceMin", ["shown"], ["is_shown"], keepdims=0),
        ]
        nodes[-1] = helper.make_node("Sub", ["is_shown", "one"], ["nothing"])
        constants.append(numpy_helper.from_array(np.float32(1), "one"))
    if sizes:
        inputs.append(
            helper.make_tensor_value_info("orig_target_sizes", TensorProto.INT64, ["n", 2])
        )
        nodes += [
            helper.make_node("Cast", ["orig_target_sizes"], ["size"], to=TensorProto.FLOAT),
            helper.make_node("Concat", ["size", "size"], ["rows"], axis=1),
            helper.make_node("Unsqueeze", ["rows", "axis"], ["sizes"]),
        ]
        constants.append(numpy_helper.from_array(np.array([1]), "axis"))
    values = []
    for name, array in outputs.items():
        kind = helper.np_dtype_to_tensor_dtype(array.dtype)
        values.append(helper.make_tensor_value_info(name, kind, [None] * array.ndim))
        constants.append(numpy_helper.from_array(array, f"{name}_constant"))
        source = f"{name}_constant"
        if sizes and name == "boxes":
            nodes.append(helper.make_node("Mul", [source, "sizes"], ["scaled"]))
            source = "scaled"
        if array.dtype == np.float32:
            nodes.append(helper.make_node("Add", [source, "nothing"], [name]))
        else:
            nodes.append(helper.make_node("Identity", [source], [name]))
    graph = helper.make_graph(nodes, "constant", inputs, values, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    helper.set_model_props(model, dict(metadata or {}))
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return path
