"""A detector so small that its answer is known: as bright as a cell of 32 pixels is, so sure it is of a car."""

import onnx
from onnx import TensorProto, helper

CELL_PX = 32


def bright_cells(
    modality: str = "dm",
    classes: str = "Car",
    size: tuple[int, int] = (64, 96),
    *,
    planes: int | None = None,
    output_classes: int | None = None,
    divisor: float = 255.0,
    **changes: str,
) -> bytes:
    """Return a file of: a box a cell, row after row, its score the cell's brightness / divisor.

    All classes have this score; `changes` are facts in place of those that fit.
    """
    height, width = size
    planes = planes or {"rgb": 3}.get(modality, 1)
    output_classes = output_classes or len(classes.split(","))
    cells = [
        [x, y, x + CELL_PX, y + CELL_PX]
        for y in range(0, height, CELL_PX)
        for x in range(0, width, CELL_PX)
    ]
    nodes = [
        helper.make_node("Cast", ["images"], ["numbers"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMean", ["numbers", "channel_axis"], ["gray"], keepdims=1),
        helper.make_node(
            "AveragePool",
            ["gray"],
            ["means"],
            kernel_shape=[CELL_PX, CELL_PX],
            strides=[CELL_PX, CELL_PX],
        ),
        helper.make_node("Reshape", ["means", "as_list"], ["listed"]),
        helper.make_node("Div", ["listed", "divisor"], ["sureness"]),
        helper.make_node("Concat", ["sureness"] * output_classes, ["scores"], axis=2),
        helper.make_node("Mul", ["listed", "zero"], ["nothing"]),
        helper.make_node("Add", ["nothing", "cells"], ["boxes_px"]),
    ]
    graph = helper.make_graph(
        nodes,
        "bright_cells",
        [
            helper.make_tensor_value_info(
                "images", TensorProto.UINT8, ["rows", planes, height, width]
            )
        ],
        [
            helper.make_tensor_value_info("boxes_px", TensorProto.FLOAT, ["rows", len(cells), 4]),
            helper.make_tensor_value_info(
                "scores", TensorProto.FLOAT, ["rows", len(cells), output_classes]
            ),
        ],
        [
            helper.make_tensor("channel_axis", TensorProto.INT64, [1], [1]),
            helper.make_tensor("as_list", TensorProto.INT64, [3], [-1, len(cells), 1]),
            helper.make_tensor("divisor", TensorProto.FLOAT, [], [divisor]),
            helper.make_tensor("zero", TensorProto.FLOAT, [], [0.0]),
            helper.make_tensor(
                "cells", TensorProto.FLOAT, [1, len(cells), 4], [n for cell in cells for n in cell]
            ),
        ],
    )
    metadata = {
        "kind": "detector",
        "network": "bright",
        "modality": modality,
        "classes": classes,
        "input_height": str(height),
        "input_width": str(width),
        "filling": "default",
    }
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
    helper.set_model_props(model, metadata | changes)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())
