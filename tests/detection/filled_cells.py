"""A detector of the bird's-eye view so small that its answer is known: the fuller a cell of 0.8 m, the surer of a car."""

import numpy as np
import onnx
from onnx import TensorProto, helper

from perception.detection.bev.bev_map import CHANNELS
from perception.detection.bev.boxes import SPLIT
from perception.detection.bev.detector import CONTRACT

_SLICE = 1  # of the returns 0.6 to 1 m above the ground
_PLACES = SPLIT**2  # of a cell; the objects are at its first, and their centres at its middle
_BOX = [1.0, 1.0, 0.0, 4.0, 1.7, 1.5, 0.0, 1.0, 0.0, 1.0, *([0.1] * 6)]


def filled_cells(classes: str = "Car") -> bytes:
    """Return a file of: a car of one size at each cell of 4x4 of the map, its score the share of it that is filled."""
    nodes = [
        helper.make_node("Cast", ["maps"], ["numbers"], to=TensorProto.FLOAT),
        helper.make_node("Gather", ["numbers", "slice"], ["filled"], axis=4),
        helper.make_node("ReduceMean", ["filled", "cells"], ["shares"], keepdims=0),
        helper.make_node("Div", ["shares", "full"], ["scores_only"]),
        helper.make_node("Unsqueeze", ["scores_only", "class"], ["of_blocks"]),
        helper.make_node("Add", ["of_blocks", "first_place"], ["scores"]),
        helper.make_node("Mul", ["of_blocks", "zero"], ["nothing"]),
        helper.make_node("Add", ["nothing", "box"], ["boxes"]),
    ]
    shape, number = ["rows", "height", "width"], TensorProto.FLOAT
    graph = helper.make_graph(
        nodes,
        "filled_cells",
        [helper.make_tensor_value_info("maps", TensorProto.UINT8, [*shape, 16, CHANNELS])],
        [
            helper.make_tensor_value_info("scores", number, ["rows", _PLACES, *shape[1:]]),
            helper.make_tensor_value_info(
                "boxes", number, ["rows", _PLACES * len(_BOX), *shape[1:]]
            ),
        ],
        [
            helper.make_tensor("slice", TensorProto.INT64, [], [_SLICE]),
            helper.make_tensor("cells", TensorProto.INT64, [1], [3]),
            helper.make_tensor("class", TensorProto.INT64, [1], [1]),
            helper.make_tensor("full", number, [], [255.0]),
            helper.make_tensor("zero", number, [], [0.0]),
            helper.make_tensor(
                "first_place", number, [1, _PLACES, 1, 1], [0.0] + [-20.0] * (_PLACES - 1)
            ),
            helper.make_tensor(
                "box", number, [1, _PLACES * len(_BOX), 1, 1], np.repeat(_BOX, _PLACES)
            ),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
    stated = {**CONTRACT.metadata, "classes": classes, "reach_m": "25.6", "cell_m": "0.2"}
    helper.set_model_props(model, stated)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())
